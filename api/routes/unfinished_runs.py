"""Runs that are not done: how far they have come, and their diagnostics so far."""

from __future__ import annotations

from datetime import datetime
from http import HTTPStatus
from typing import Any, Literal

from fastapi import APIRouter, Request, Response
from pydantic import BaseModel

from api.http.caching import JSON, json_response
from api.http.problems import documented
from api.results.run_arrays import SeriesDocument, SeriesSelection, UnfinishedSeries
from api.results.scene_units import SceneUnits
from api.routes.runs import MAXIMUM_NUMBER, RunKey, SeriesNames, Start, Stop, Stride
from api.routes.service import Reader, Service
from api.routes.streaming import stream
from ensemble.errors import NotStored
from ensemble.store.unfinished import UnfinishedRun, unfinished_run
from solver.scene import Scene

router = APIRouter(prefix="/unfinished-runs", tags=["runs"])

_RESPONSES: dict[int | str, dict[str, Any]] = documented(HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT)


class UnfinishedDocument(BaseModel):
    """How far a run has come, at its last checkpoint.

    Attributes
    ----------
    run_key : str
    status : str
        Whether a process goes on with it.
    written : datetime
        When the checkpoint was written.
    time : float or None
        That it has reached; null while its start relaxes.
    horizon : float
        The latest time of the run.
    wall_seconds : float
    samples, frames : int
        How many diagnostics and states are recorded.
    last : dict
        The diagnostics that were recorded last, by name; null where one is not finite.
    scene : Scene
    """

    run_key: str
    status: Literal["in progress", "interrupted"]
    written: datetime
    time: float | None
    horizon: float
    wall_seconds: float
    samples: int
    frames: int
    last: dict[str, float | None]
    scene: Scene


@router.get("/{key}", response_model=UnfinishedDocument, responses=_RESPONSES)
def get_unfinished_run(reader: Reader, key: RunKey) -> Response:
    """Say how far a run has come that is not done, as its last checkpoint shows it.

    Parameters
    ----------
    reader : Caller
    key : str

    Returns
    -------
    Response

    Raises
    ------
    NotStored
        If no run of this key has a checkpoint.
    UnfinishedRunError
        If what is kept of the run cannot be used; the answer says to ask again, or that it begins anew.
    """
    return json_response(UnfinishedDocument.model_validate(_found(reader.service, key).json_document()))


@router.get("/{key}/series", response_model=SeriesDocument, responses=_RESPONSES)
def get_unfinished_series(
    request: Request,
    reader: Reader,
    key: RunKey,
    name: SeriesNames = [],  # noqa: B006  FastAPI copies it
    start: Start = 0,
    stop: Stop = MAXIMUM_NUMBER,
    stride: Stride = 1,
) -> Response:
    """Give the diagnostics of a run that is not done, as far as its last checkpoint.

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
        If no run of this key has a checkpoint.
    UnfinishedRunError
        If what is kept of the run cannot be used; the answer says to ask again, or that it begins anew.
    BadInput
        If there is no diagnostic of a name, or there are too many records for one answer.
    """
    arrays = UnfinishedSeries(_found(reader.service, key).series())
    numbers = range(start, stop, stride)
    selection = SeriesSelection.of(arrays, name, numbers, reader.service.settings.frame_values)
    return stream(reader, request, selection.json(), JSON)


@router.get("/{key}/units", response_model=SceneUnits, responses=_RESPONSES)
def get_units_of_unfinished_run(reader: Reader, key: RunKey) -> Response:
    """Say how much one is of every number of a run that has a unit.

    Parameters
    ----------
    reader : Caller
    key : str

    Returns
    -------
    Response

    Raises
    ------
    NotStored
        If no run of this key has a checkpoint.
    UnfinishedRunError
        If what is kept of the run cannot be used; the answer says to ask again, or that it begins anew.
    """
    return json_response(SceneUnits.of(_found(reader.service, key).scene))


def _found(service: Service, key: str) -> UnfinishedRun:
    found = unfinished_run(service.store.path, key)
    if found is None:
        raise NotStored(f"run: there is no unfinished run {key} with a checkpoint")
    return found
