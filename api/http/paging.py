"""Collections in pages: at most `limit` items, starting with the one that follows `after`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Annotated, Generic, TypeVar
from urllib.parse import urlsplit

from fastapi import Query, Request, Response
from pydantic import BaseModel, StringConstraints

from api.http.caching import json_response
from ensemble.store import Record

Item = TypeVar("Item")

Limit = Annotated[int, Query(ge=1, le=1000, description="Largest number of items.")]
After = Annotated[
    str | None,
    Query(max_length=64, pattern="^[0-9a-z-]+$", description="Key of the last item of the previous page."),
]
Where = Annotated[
    list[Annotated[str, StringConstraints(max_length=1000)]],
    Query(max_length=20, description="Conditions such as flow.rate>=0.5 or outcome=bound. All must hold."),
]


class CollectionPage(BaseModel, Generic[Item]):
    """A page of a collection; `next` is the address of the page that follows, null on the last page.

    It is relative to the address of this page, so it also holds behind a proxy that adds a prefix.
    """

    items: list[Item]
    next: str | None


def page_response(request: Request, records: Sequence[Record], limit: int) -> Response:
    """Return a page of a collection.

    The records are JSON already, so the page is assembled from their text.

    Parameters
    ----------
    request : Request
        The request for this page; the address of the next page is made from it.
    records : sequence of Record
        Up to ``limit + 1`` records: the additional one shows that there is a next page.
    limit : int
        Largest number of items of the page.

    Returns
    -------
    Response
    """
    items = records[:limit]
    next_page = None
    if len(records) > limit:
        parts = urlsplit(str(request.url.include_query_params(after=items[-1].key)))
        next_page = f"{parts.path.rpartition('/')[2]}?{parts.query}"
    listed = ",".join(record.json for record in items)
    return json_response(f'{{"items":[{listed}],"next":{json.dumps(next_page)}}}')
