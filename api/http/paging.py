"""Collections in parts: at most `limit` elements, from the one that follows `after`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Annotated
from urllib.parse import urlsplit

from fastapi import Query, Request, Response

from api.http.caching import written
from ensemble.store import Record

Limit = Annotated[int, Query(ge=1, le=1000, description="How many elements at most.")]
After = Annotated[
    str | None,
    Query(max_length=64, pattern="^[0-9a-z-]+$", description="Key of the element before the first."),
]
Where = Annotated[
    list[str],
    Query(max_length=20, description="Conditions such as flow.rate>=0.5 or outcome=bound, all to be met."),
]


def page(request: Request, found: Sequence[Record], limit: int) -> Response:
    """Answer with a page of what was found when one more than `limit` was looked for.

    The records are JSON already, so the page is put together from their text.
    """
    items = found[:limit]
    following = None
    if len(found) > limit:
        parts = urlsplit(str(request.url.include_query_params(after=items[-1].key)))
        following = f"{parts.path}?{parts.query}"
    listed = ",".join(record.json for record in items)
    return written(f'{{"items":[{listed}],"next":{json.dumps(following)}}}')
