"""Long answers, which are sent piece by piece as long as the token of the request is valid."""

from __future__ import annotations

import logging
from collections.abc import AsyncIterator, Iterator
from itertools import chain

from fastapi import Request, Response
from fastapi.responses import StreamingResponse
from starlette.concurrency import iterate_in_threadpool

from api.http.problems import OUTAGES, unavailable
from api.results.downloads import MEDIA_TYPES, NoFile
from api.routes.service import Caller
from ensemble.store.sql_database import reason

_log = logging.getLogger("uvicorn.error")

BEGINNING_BYTES = 1 << 16


def stream(caller: Caller, request: Request, pieces: Iterator[bytes], media_type: str) -> StreamingResponse:
    """Return an answer that is made while it is sent.

    Its beginning, and so all of a short answer, is made at once: an error in it is answered as such. If the
    token of the request is revoked or expires, or the disk or the database fails, the connection is closed:
    the client sees that the answer is incomplete.

    Parameters
    ----------
    caller : Caller
        Who makes the request.
    request : Request
    pieces : iterator of bytes
        Made in another thread.
    media_type : str

    Returns
    -------
    StreamingResponse
    """
    beginning = bytearray()
    while len(beginning) < BEGINNING_BYTES and (piece := next(pieces, None)) is not None:
        beginning += piece
    all_pieces = chain([bytes(beginning)], pieces)

    async def while_valid() -> AsyncIterator[bytes]:
        try:
            async for piece in iterate_in_threadpool(all_pieces):
                if not await caller.is_valid():
                    break
                yield piece
            else:
                return
        except OUTAGES as error:
            _log.error("%s: %s", request.url.path, reason(error))
        request.state.connection.abort()

    return StreamingResponse(while_valid(), media_type=media_type)


def stream_file(caller: Caller, request: Request, key: str, suffix: str) -> Response:
    """Return a run or a boundary as a file that is made for it.

    Parameters
    ----------
    caller : Caller
        Who makes the request.
    request : Request
    key : str
        Of a run or a boundary that is stored.
    suffix : str
        Of the file.

    Returns
    -------
    Response

    Raises
    ------
    Problem
        If the file cannot be made now.
    """
    try:
        pieces = caller.service.downloads.pieces(key, suffix)
    except NoFile as error:
        raise unavailable(str(error)) from error
    return stream(caller, request, pieces, MEDIA_TYPES[suffix])


def as_file(response: Response, name: str) -> Response:
    """Let browsers keep an answer as a file.

    Parameters
    ----------
    response : Response
    name : str
        Of the file.

    Returns
    -------
    Response
        The same.
    """
    response.headers["Content-Disposition"] = f'attachment; filename="{name}"'
    return response
