"""Traced boundaries, and critical values read off them."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request, Response
from pydantic import FiniteFloat, TypeAdapter, ValidationError

from api.auth.callers import Reader
from api.http.caching import ASK_AGAIN, NOT_MODIFIED, cached, etag, written
from api.http.paging import After, Limit, Where, page
from api.http.problems import documented
from api.http.schemas import BoundaryDocument, CriticalValueAt, Method, Page
from api.results.boundary_values import critical_value_at, fitted
from ensemble.errors import BadInput
from ensemble.store import Record

router = APIRouter(prefix="/boundaries", tags=["boundaries"])

StudyKey = Annotated[str, Path(pattern="^[0-9a-f]{16}$", description="Key of the study.")]
NUMBER = TypeAdapter(FiniteFloat)
# A dotted path is no name that a function's parameter could have.
PARAMETERS: dict[str, Any] = {
    "parameters": [
        {
            "in": "query",
            "name": "parameters",
            "description": "The swept parameter by its dotted path, such as flow.rate=0.6.",
            "required": True,
            "style": "form",
            "explode": True,
            "schema": {"type": "object", "additionalProperties": {"type": "number"}},
        }
    ]
}


@router.get("", response_model=Page[BoundaryDocument])
def list_boundaries(
    request: Request,
    reader: Reader,
    where: Where = [],  # noqa: B006  FastAPI copies it
    after: After = None,
    limit: Limit = 100,
) -> Response:
    """List the boundaries that meet all conditions, by their keys."""
    found = reader.service.store.boundaries_page(where, after, limit + 1)
    return page(request, [Record(key, fitted(recorded)) for key, recorded in found], limit)


@router.get(
    "/{key}", response_model=BoundaryDocument, responses=NOT_MODIFIED | documented(HTTPStatus.NOT_FOUND)
)
async def get_boundary(request: Request, reader: Reader, key: StudyKey) -> Response:
    """Give a boundary as far as it is known: points, brackets, outcomes, and the line through them."""
    record = await reader.service.look_up(reader.service.store.boundary_record, key)
    return cached(request, etag(record.json), ASK_AGAIN, lambda: written(fitted(record.json)))


@router.get("/{key}/at", openapi_extra=PARAMETERS, responses=documented(HTTPStatus.NOT_FOUND))
def get_critical_value(
    request: Request,
    reader: Reader,
    key: StudyKey,
    method: Annotated[
        Method, Query(description="Between two points, or of the nearest.")
    ] = Method.INTERPOLATED,
) -> CriticalValueAt:
    """Read a critical value off a boundary, with its uncertainty."""
    boundary = reader.service.store.boundary(key)
    given = {name: text for name, text in request.query_params.multi_items() if name != "method"}
    return critical_value_at(boundary, {name: _number(name, text) for name, text in given.items()}, method)


def _number(name: str, text: str) -> float:
    try:
        return NUMBER.validate_strings(text)
    except ValidationError:
        raise BadInput(f"{name}: {text!r} — must be a finite number") from None
