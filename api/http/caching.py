"""Answers with an ETag: a client that already has the document gets 304 instead of a second copy."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from http import HTTPStatus
from typing import Any

from fastapi import Request, Response
from pydantic import BaseModel

JSON = "application/json"
IMMUTABLE = "private, max-age=31536000, immutable"
REVALIDATE = "private, no-cache"

NOT_MODIFIED: dict[int | str, dict[str, Any]] = {
    HTTPStatus.NOT_MODIFIED.value: {
        "description": "The client's copy, named by If-None-Match, is the latest."
    }
}


def etag(*parts: str) -> str:
    """Return an entity tag for a document.

    Parameters
    ----------
    *parts : str
        Everything that determines the document's content.

    Returns
    -------
    str
        The tag, in quotes.
    """
    return f'"{hashlib.sha256("/".join(parts).encode()).hexdigest()[:32]}"'


def json_response(document: BaseModel | str) -> Response:
    """Return a JSON answer without the second validation that FastAPI would do.

    Parameters
    ----------
    document : BaseModel or str
        A model, or text that is JSON already.

    Returns
    -------
    Response
    """
    return Response(document if isinstance(document, str) else document.model_dump_json(), media_type=JSON)


def cached_response(request: Request, tag: str, cache_control: str, make: Callable[[], Response]) -> Response:
    """Return 304 if the client has the document of this tag, else the document.

    Parameters
    ----------
    request : Request
    tag : str
        From `etag`.
    cache_control : str
        `IMMUTABLE` for a document that never changes, else `REVALIDATE`.
    make : callable
        Makes the full answer; called only if it is needed.

    Returns
    -------
    Response
    """
    candidates = request.headers.get("if-none-match", "").split(",")
    is_current = tag in (candidate.strip().removeprefix("W/") for candidate in candidates)
    response = Response(status_code=HTTPStatus.NOT_MODIFIED) if is_current else make()
    response.headers["ETag"] = tag
    response.headers["Cache-Control"] = cache_control
    response.headers["Vary"] = "Accept, Authorization"
    return response
