"""Stored runs: their results, their diagnostics over time and their recorded states."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request, Response

from api.http.caching import IMMUTABLE, NOT_MODIFIED, cached_response, etag, json_response
from api.http.paging import After, CollectionPage, Limit, Where, page_response
from api.http.problems import documented
from api.results.flow_field import FlowField, flow_field
from api.results.run_arrays import (
    FramesDocument,
    SeriesDocument,
    frames_bytes,
    frames_document,
    select_frames,
    series_document,
)
from api.routes.service import Reader
from ensemble.store.run_record import RunSummary

BINARY = "application/octet-stream"
MAXIMUM_FRAME = 1_000_000_000

router = APIRouter(prefix="/runs", tags=["runs"])

RunKey = Annotated[str, Path(pattern="^[0-9a-f]{32}$", description="Key of the run.")]
RUN_RESPONSES: dict[int | str, dict[str, Any]] = NOT_MODIFIED | documented(HTTPStatus.NOT_FOUND)
FRAMES_RESPONSE: dict[int | str, dict[str, Any]] = {
    HTTPStatus.OK.value: {
        "description": (
            "JSON or, by the header Accept, little-endian float32: for each frame its time, then for each "
            "vesicle x of all points, y of all points and the tensions at these points."
        ),
        "content": {BINARY: {"schema": {"type": "string", "format": "binary"}}},
    }
}


@router.get("", response_model=CollectionPage[RunSummary])
def list_runs(
    request: Request,
    reader: Reader,
    where: Where = [],  # noqa: B006  FastAPI copies it
    after: After = None,
    limit: Limit = 100,
) -> Response:
    """List the runs that meet all conditions, the newest first.

    Parameters
    ----------
    request : Request
    reader : Caller
    where : list of str
        Conditions that all items meet.
    after : str or None
        Key of the last item of the previous page.
    limit : int
        Largest number of items.

    Returns
    -------
    Response
    """
    return page_response(request, reader.service.store.runs_page(where, after, limit + 1), limit)


@router.get("/{key}", response_model=RunSummary, responses=RUN_RESPONSES)
async def get_run(request: Request, reader: Reader, key: RunKey) -> Response:
    """Give everything about a run except its arrays.

    Parameters
    ----------
    request : Request
    reader : Caller
    key : str

    Returns
    -------
    Response

    Raises
    ------
    NotStored
        If there is no run of this key.
    """
    record = await reader.service.look_up(reader.service.store.run_record, key)
    return cached_response(request, etag(key), IMMUTABLE, lambda: json_response(record.json))


@router.get("/{key}/series", response_model=SeriesDocument, responses=RUN_RESPONSES)
def get_series(
    request: Request,
    reader: Reader,
    key: RunKey,
    name: Annotated[
        list[str], Query(max_length=50, description="Names of diagnostics; without any, all are given.")
    ] = [],  # noqa: B006
) -> Response:
    """Give the diagnostics of a run over time.

    Parameters
    ----------
    request : Request
    reader : Caller
    key : str
    name : list of str
        Names of diagnostics; all if it is empty.

    Returns
    -------
    Response

    Raises
    ------
    NotStored
        If there is no run of this key.
    """

    def make() -> Response:
        return json_response(series_document(reader.service.store.load(key), name))

    return cached_response(request, etag(key, "series", *sorted(name)), IMMUTABLE, make)


@router.get("/{key}/frames", response_model=FramesDocument, responses=RUN_RESPONSES | FRAMES_RESPONSE)
def get_frames(
    request: Request,
    reader: Reader,
    key: RunKey,
    start: Annotated[int, Query(ge=0, le=MAXIMUM_FRAME, description="Number of the first frame.")] = 0,
    stop: Annotated[
        int, Query(ge=0, le=MAXIMUM_FRAME, description="Number of the frame after the last.")
    ] = MAXIMUM_FRAME,
    stride: Annotated[int, Query(ge=1, le=MAXIMUM_FRAME, description="Step from frame to frame.")] = 1,
) -> Response:
    """Give the recorded states of a run.

    Parameters
    ----------
    request : Request
    reader : Caller
    key : str
    start, stop, stride : int
        Numbers of the frames, as in `range`.

    Returns
    -------
    Response

    Raises
    ------
    NotStored
        If there is no run of this key.
    """
    is_binary = BINARY in request.headers.get("accept", "")

    def make() -> Response:
        run = reader.service.store.load(key)
        states = select_frames(run, range(start, stop, stride), reader.service.settings.frame_values)
        if is_binary:
            return Response(frames_bytes(states), media_type=BINARY)
        return json_response(frames_document(states))

    tag = etag(key, "frames", f"{start}:{stop}:{stride}:{is_binary}")
    return cached_response(request, tag, IMMUTABLE, make)


@router.get("/{key}/flow", response_model=FlowField | None, responses=RUN_RESPONSES)
def get_flow(request: Request, reader: Reader, key: RunKey) -> Response:
    """Give the imposed velocity around the vesicles of a run; null in a fluid at rest.

    Parameters
    ----------
    request : Request
    reader : Caller
    key : str

    Returns
    -------
    Response

    Raises
    ------
    NotStored
        If there is no run of this key.
    """

    def make() -> Response:
        field = flow_field(reader.service.store.load(key))
        return json_response("null" if field is None else field)

    return cached_response(request, etag(key, "flow"), IMMUTABLE, make)
