"""Stored runs: their results, their diagnostics over time and their recorded states."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request, Response
from pydantic import StringConstraints

from api.http.caching import IMMUTABLE, JSON, NOT_MODIFIED, cached_response, etag, json_response
from api.http.paging import After, CollectionPage, Limit, Where, page_response
from api.http.problems import documented
from api.results.downloads import RunFile, file_response
from api.results.flow_field import FlowField, flow_field
from api.results.run_arrays import FramesDocument, FrameSelection, SeriesDocument, SeriesSelection, centers
from api.results.scene_units import SceneUnits
from api.routes.service import Reader
from api.routes.streaming import as_file, stream, stream_file
from ensemble.store.filters import without_reports
from ensemble.store.run_record import RunSummary

BINARY = "application/octet-stream"
MAXIMUM_NUMBER = 1_000_000_000

router = APIRouter(prefix="/runs", tags=["runs"])

RunKey = Annotated[str, Path(pattern="^[0-9a-f]{32}$", description="Key of the run.")]
SeriesNames = Annotated[
    list[Annotated[str, StringConstraints(max_length=100)]],
    Query(max_length=50, description="Names of diagnostics; without any, all are given."),
]
Start = Annotated[int, Query(ge=0, le=MAXIMUM_NUMBER, description="Number of the first one.")]
Stop = Annotated[int, Query(ge=0, le=MAXIMUM_NUMBER, description="Number of the one after the last.")]
Stride = Annotated[int, Query(ge=1, le=MAXIMUM_NUMBER, description="Step from one to the next.")]
RUN_RESPONSES: dict[int | str, dict[str, Any]] = NOT_MODIFIED | documented(
    HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT
)
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
    reports: Annotated[bool, Query(description="Whether those made for reports are listed.")] = False,
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
    reports : bool
        Whether runs that were made for reports are listed.

    Returns
    -------
    Response
    """
    filters = where if reports else without_reports(where)
    return page_response(request, reader.service.store.runs_page(filters, after, limit + 1), limit)


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
    name: SeriesNames = [],  # noqa: B006  FastAPI copies it
    start: Start = 0,
    stop: Stop = MAXIMUM_NUMBER,
    stride: Stride = 1,
) -> Response:
    """Give the diagnostics of a run over time; of a long run some of the records.

    Parameters
    ----------
    request : Request
    reader : Caller
    key : str
    name : list of str
        Names of diagnostics; all if it is empty.
    start, stop, stride : int
        Numbers of the records, as in `range`.

    Returns
    -------
    Response

    Raises
    ------
    NotStored
        If there is no run of this key.
    BadInput
        If there is no diagnostic of a name, or there are too many records for one answer.
    """

    def make() -> Response:
        service = reader.service
        numbers = range(start, stop, stride)
        selection = SeriesSelection.of(
            service.store.arrays(key), name, numbers, service.settings.frame_values
        )
        return stream(reader, request, selection.json(), JSON)

    tag = etag(key, "series", *sorted(name), f"{start}:{stop}:{stride}")
    return cached_response(request, tag, IMMUTABLE, make)


@router.get("/{key}/frames", response_model=FramesDocument, responses=RUN_RESPONSES | FRAMES_RESPONSE)
def get_frames(
    request: Request,
    reader: Reader,
    key: RunKey,
    start: Start = 0,
    stop: Stop = MAXIMUM_NUMBER,
    stride: Stride = 1,
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
        service = reader.service
        arrays, most = service.store.arrays(key), service.settings.frame_values
        selection = FrameSelection.of(arrays, range(start, stop, stride), most)
        if not is_binary:
            return stream(reader, request, selection.json(), JSON)
        response = stream(reader, request, selection.binary(), BINARY)
        response.headers["Content-Length"] = str(selection.size)
        return response

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
        arrays = reader.service.store.arrays(key)
        field = flow_field(arrays.summary.scene, centers(arrays))
        return json_response("null" if field is None else field)

    return cached_response(request, etag(key, "flow"), IMMUTABLE, make)


@router.get("/{key}/units", response_model=SceneUnits, responses=RUN_RESPONSES)
def get_units(request: Request, reader: Reader, key: RunKey) -> Response:
    """Say how much one is of every number of a run that has a unit.

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
    scene = reader.service.store.summary(key).scene
    return cached_response(
        request, etag(key, "units"), IMMUTABLE, lambda: json_response(SceneUnits.of(scene))
    )


@router.get("/{key}/file", responses=RUN_RESPONSES | file_response(RunFile))
def get_file(
    request: Request,
    reader: Reader,
    key: RunKey,
    format: Annotated[RunFile, Query(description="Suffix of the file.")],
) -> Response:
    """Give a run as a file: all of it (HDF5), a movie, or a figure.

    Parameters
    ----------
    request : Request
    reader : Caller
    key : str
    format : RunFile

    Returns
    -------
    Response

    Raises
    ------
    NotStored
        If there is no run of this key.
    BadInput
        If the run cannot be drawn so.
    """
    reader.service.store.run_record(key)

    def make() -> Response:
        return as_file(stream_file(reader, request, key, format), f"run-{key[:8]}.{format}")

    return cached_response(request, etag(key, "file", format), IMMUTABLE, make)
