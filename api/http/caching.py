"""ETags: a client that has a document already is told so instead of being sent it again."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from http import HTTPStatus
from typing import Any

from fastapi import Request, Response
from pydantic import BaseModel

JSON = "application/json"
FOR_EVER = "private, max-age=31536000, immutable"
ASK_AGAIN = "private, no-cache"

NOT_MODIFIED: dict[int | str, dict[str, Any]] = {
    HTTPStatus.NOT_MODIFIED.value: {
        "description": "The client's copy, named by If-None-Match, is the latest."
    }
}


def etag(*parts: str) -> str:
    """Make the tag of a document from what identifies its contents."""
    return f'"{hashlib.sha256("/".join(parts).encode()).hexdigest()[:32]}"'


def written(document: BaseModel | str) -> Response:
    """Answer with a document as it is: it needs no second validation on its way out."""
    return Response(document if isinstance(document, str) else document.model_dump_json(), media_type=JSON)


def cached(request: Request, tag: str, control: str, make: Callable[[], Response]) -> Response:
    """Answer with a document, which is made only if the client does not have the one of this tag.

    Parameters
    ----------
    request : Request
    tag : str
        From `etag`.
    control : str
        `FOR_EVER` for what never changes, else `ASK_AGAIN`.
    make : callable
        Makes the whole answer.
    """
    candidates = request.headers.get("if-none-match", "").split(",")
    has_it = tag in (candidate.strip().removeprefix("W/") for candidate in candidates)
    response = Response(status_code=HTTPStatus.NOT_MODIFIED) if has_it else make()
    response.headers["ETag"] = tag
    response.headers["Cache-Control"] = control
    response.headers["Vary"] = "Accept, Authorization"
    return response
