"""Traced boundaries, and critical values read from them."""

from __future__ import annotations

from collections import Counter
from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request, Response
from pydantic import FiniteFloat, TypeAdapter, ValidationError

from api.http.caching import NOT_MODIFIED, REVALIDATE, cached_response, etag, json_response
from api.http.paging import After, CollectionPage, Limit, Where, page_response
from api.http.problems import documented
from api.results.boundary_values import BoundaryDocument, fitted_boundary
from api.results.downloads import MEDIA_TYPES, BoundaryFile, boundary_table, file_response
from api.results.scene_units import SceneUnits
from api.routes.service import Reader
from api.routes.streaming import as_file, stream_file
from ensemble.errors import BadInput
from ensemble.search.boundary_reading import CriticalValueDocument, ReadingMethod, critical_value_at
from ensemble.store import Record
from ensemble.store.run_record import RunSummary

router = APIRouter(prefix="/boundaries", tags=["boundaries"])

StudyKey = Annotated[str, Path(pattern="^[0-9a-f]{16}$", description="Key of the study.")]
NUMBER = TypeAdapter(FiniteFloat)
# The names of these parameters are dotted paths, so they cannot be arguments of the function.
SWEPT_PARAMETERS: dict[str, Any] = {
    "parameters": [
        {
            "in": "query",
            "name": "parameters",
            "description": "Each swept parameter by its dotted path, for example flow.rate=0.6.",
            "required": True,
            "style": "form",
            "explode": True,
            "schema": {"type": "object", "additionalProperties": {"type": "number"}},
        }
    ]
}


@router.get("", response_model=CollectionPage[BoundaryDocument])
def list_boundaries(
    request: Request,
    reader: Reader,
    where: Where = [],  # noqa: B006  FastAPI copies it
    after: After = None,
    limit: Limit = 100,
) -> Response:
    """List the boundaries that meet all conditions, in the order of their keys.

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
    records = reader.service.store.boundaries_page(where, after, limit + 1)
    return page_response(
        request, [Record(key, fitted_boundary(recorded)) for key, recorded in records], limit
    )


@router.get(
    "/{key}", response_model=BoundaryDocument, responses=NOT_MODIFIED | documented(HTTPStatus.NOT_FOUND)
)
async def get_boundary(request: Request, reader: Reader, key: StudyKey) -> Response:
    """Give the present state of a boundary: points, brackets, outcomes, and the line through the points.

    Parameters
    ----------
    request : Request
    reader : Caller
    key : str
        Key of the study.

    Returns
    -------
    Response

    Raises
    ------
    NotStored
        If there is no boundary of this key.
    """
    record = await reader.service.look_up(reader.service.store.boundary_record, key)
    return cached_response(
        request, etag(record.json), REVALIDATE, lambda: json_response(fitted_boundary(record.json))
    )


@router.get(
    "/{key}/runs", response_model=CollectionPage[RunSummary], responses=documented(HTTPStatus.NOT_FOUND)
)
def list_runs_of_boundary(
    request: Request, reader: Reader, key: StudyKey, after: After = None, limit: Limit = 100
) -> Response:
    """List the runs that a boundary rests on, in the order of their keys.

    Parameters
    ----------
    request : Request
    reader : Caller
    key : str
        Key of the study.
    after : str or None
        Key of the last run of the previous page.
    limit : int
        Largest number of runs.

    Returns
    -------
    Response

    Raises
    ------
    NotStored
        If there is no boundary of this key.
    """
    return page_response(request, reader.service.store.boundary_runs_page(key, after, limit + 1), limit)


@router.get("/{key}/at", openapi_extra=SWEPT_PARAMETERS, responses=documented(HTTPStatus.NOT_FOUND))
def get_critical_value(
    request: Request,
    reader: Reader,
    key: StudyKey,
    method: Annotated[
        ReadingMethod, Query(description="Interpolate between points, or take the nearest point.")
    ] = ReadingMethod.INTERPOLATED,
) -> CriticalValueDocument:
    """Read a critical value and its uncertainty from a boundary.

    Parameters
    ----------
    request : Request
    reader : Caller
    key : str
        Key of the study.
    method : ReadingMethod

    Returns
    -------
    CriticalValueDocument

    Raises
    ------
    NotStored
        If there is no boundary of this key.
    BadInput
        If a value of a swept parameter is missing, is given twice, is no number or lies outside the boundary.
    """
    boundary = reader.service.store.boundary(key)
    given = [(name, text) for name, text in request.query_params.multi_items() if name != "method"]
    parameters = {name: _number(name, text) for name, text in given}
    if len(given) > len(parameters):
        twice = ", ".join(name for name, times in Counter(name for name, _ in given).items() if times > 1)
        raise BadInput(f"{twice}: given several times — must be given once")
    return critical_value_at(boundary, parameters, method)


@router.get("/{key}/units", responses=documented(HTTPStatus.NOT_FOUND))
def get_units(reader: Reader, key: StudyKey) -> SceneUnits:
    """Say how much one is of every number of a boundary, and of its runs, that has a unit.

    Parameters
    ----------
    reader : Caller
    key : str
        Key of the study.

    Returns
    -------
    SceneUnits

    Raises
    ------
    NotStored
        If there is no boundary of this key.
    """
    boundary = reader.service.store.boundary(key)
    return SceneUnits.of(boundary.scene, (*boundary.swept, boundary.searched))


@router.get(
    "/{key}/file", responses=NOT_MODIFIED | documented(HTTPStatus.NOT_FOUND) | file_response(BoundaryFile)
)
def get_boundary_file(
    request: Request,
    reader: Reader,
    key: StudyKey,
    format: Annotated[BoundaryFile, Query(description="Suffix of the file.")],
) -> Response:
    """Give a boundary as a file: its points as a table (CSV), or its phase diagram.

    Parameters
    ----------
    request : Request
    reader : Caller
    key : str
        Key of the study.
    format : BoundaryFile

    Returns
    -------
    Response

    Raises
    ------
    NotStored
        If there is no boundary of this key.
    """
    boundary = reader.service.store.boundary(key)

    def make() -> Response:
        if format is BoundaryFile.CSV:
            return Response(boundary_table(boundary), media_type=MEDIA_TYPES[format])
        return stream_file(reader, request, key, format)

    tag = etag(boundary.model_dump_json(), "file", format)
    return as_file(cached_response(request, tag, REVALIDATE, make), f"boundary-{key[:8]}.{format}")


def _number(name: str, text: str) -> float:
    try:
        return NUMBER.validate_strings(text)
    except ValidationError:
        raise BadInput(f"{name}: {text!r} — must be a finite number") from None
