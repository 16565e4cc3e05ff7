"""Stored runs: their results, their diagnostics over time and their recorded states."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request, Response

from api.auth.callers import Reader
from api.http.caching import FOR_EVER, NOT_MODIFIED, cached, etag, written
from api.http.paging import After, Limit, Where, page
from api.http.problems import documented
from api.http.schemas import FramesDocument, Page, SeriesDocument
from api.results.frames import frames_bytes, frames_document, select_frames
from api.results.series import series_document
from ensemble.store.run_record import RunSummary

OCTETS = "application/octet-stream"
MOST_FRAMES = 1_000_000_000

router = APIRouter(prefix="/runs", tags=["runs"])

RunKey = Annotated[str, Path(pattern="^[0-9a-f]{32}$", description="Key of the run.")]
OF_A_RUN: dict[int | str, dict[str, Any]] = NOT_MODIFIED | documented(HTTPStatus.NOT_FOUND)
FRAMES: dict[int | str, dict[str, Any]] = {
    HTTPStatus.OK.value: {
        "description": (
            "JSON or, by the header Accept, little-endian float32: for each frame its time, then for each "
            "vesicle x of all points, y of all points and the tensions there."
        ),
        "content": {OCTETS: {"schema": {"type": "string", "format": "binary"}}},
    }
}


@router.get("", response_model=Page[RunSummary])
def list_runs(
    request: Request,
    reader: Reader,
    where: Where = [],  # noqa: B006  FastAPI copies it
    after: After = None,
    limit: Limit = 100,
) -> Response:
    """List the runs that meet all conditions, newest first."""
    return page(request, reader.service.store.runs_page(where, after, limit + 1), limit)


@router.get("/{key}", response_model=RunSummary, responses=OF_A_RUN)
async def get_run(request: Request, reader: Reader, key: RunKey) -> Response:
    """Give everything about a run except its arrays."""
    record = await reader.service.look_up(reader.service.store.run_record, key)
    return cached(request, etag(key), FOR_EVER, lambda: written(record.json))


@router.get("/{key}/series", response_model=SeriesDocument, responses=OF_A_RUN)
def get_series(
    request: Request,
    reader: Reader,
    key: RunKey,
    name: Annotated[list[str], Query(max_length=50, description="Diagnostics; all if left out.")] = [],  # noqa: B006
) -> Response:
    """Give the diagnostics of a run over time."""

    def make() -> Response:
        return written(series_document(reader.service.store.load(key), name))

    return cached(request, etag(key, "series", *sorted(name)), FOR_EVER, make)


@router.get("/{key}/frames", response_model=FramesDocument, responses=OF_A_RUN | FRAMES)
def get_frames(
    request: Request,
    reader: Reader,
    key: RunKey,
    start: Annotated[int, Query(ge=0, le=MOST_FRAMES, description="First frame.")] = 0,
    stop: Annotated[int, Query(ge=0, le=MOST_FRAMES, description="The frame after the last.")] = MOST_FRAMES,
    stride: Annotated[int, Query(ge=1, le=MOST_FRAMES, description="Give every so many-th frame.")] = 1,
) -> Response:
    """Give the recorded states of a run."""
    octets = OCTETS in request.headers.get("accept", "")

    def make() -> Response:
        run = reader.service.store.load(key)
        states = select_frames(run, start, stop, stride, reader.service.settings.frame_values)
        if octets:
            return Response(frames_bytes(states), media_type=OCTETS)
        return written(frames_document(states))

    return cached(request, etag(key, "frames", f"{start}:{stop}:{stride}:{octets}"), FOR_EVER, make)
