"""Collections in parts: at most `limit` elements, from the one that follows `after`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated
from urllib.parse import urlsplit

from fastapi import Query, Request

from api.schemas import Item, Page

Limit = Annotated[int, Query(ge=1, le=1000, description="How many elements at most.")]
After = Annotated[
    str | None,
    Query(max_length=64, pattern="^[0-9a-z-]+$", description="Key of the element before the first."),
]
Where = Annotated[
    list[str],
    Query(max_length=20, description="Conditions such as flow.rate>=0.5 or outcome=bound, all to be met."),
]


def page(request: Request, found: Sequence[Item], limit: int, key: Callable[[Item], str]) -> Page[Item]:
    """Make a page of what was found when one more than `limit` was looked for."""
    items = list(found[:limit])
    if len(found) <= limit:
        return Page(items=items, next=None)
    following = urlsplit(str(request.url.include_query_params(after=key(items[-1]))))
    return Page(items=items, next=f"{following.path}?{following.query}")
