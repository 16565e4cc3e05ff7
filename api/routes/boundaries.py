"""Traced boundaries, and critical values read off them."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request, Response
from pydantic import FiniteFloat, TypeAdapter, ValidationError

from api.auth import Reader
from api.boundary import boundary_document, critical_value_at
from api.caching import ASK_AGAIN, NOT_MODIFIED, cached, etag, written
from api.paging import After, Limit, Where, page
from api.problems import documented
from api.schemas import BoundaryDocument, CriticalValueAt, Method, Page
from api.service import ServiceOf
from ensemble.errors import BadInput
from ensemble.timestamp import timestamp_text

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


@router.get("")
def list_boundaries(
    request: Request,
    service: ServiceOf,
    reader: Reader,
    where: Where = [],  # noqa: B006  FastAPI copies it
    after: After = None,
    limit: Limit = 100,
) -> Page[BoundaryDocument]:
    """List the boundaries that meet all conditions, by their keys."""
    found = service.store.boundaries_page(where, after, limit + 1)
    return page(
        request, [boundary_document(boundary) for boundary in found], limit, key=lambda found: found.study_key
    )


@router.get(
    "/{key}", response_model=BoundaryDocument, responses=NOT_MODIFIED | documented(HTTPStatus.NOT_FOUND)
)
def get_boundary(request: Request, service: ServiceOf, reader: Reader, key: StudyKey) -> Response:
    """Give a boundary as far as it is known: points, brackets, outcomes, and the line through them."""
    boundary = service.store.boundary(key)

    def make() -> Response:
        return written(boundary_document(boundary))

    return cached(request, etag(key, timestamp_text(boundary.updated)), ASK_AGAIN, make)


@router.get("/{key}/at", openapi_extra=PARAMETERS, responses=documented(HTTPStatus.NOT_FOUND))
def get_critical_value(
    request: Request,
    service: ServiceOf,
    reader: Reader,
    key: StudyKey,
    method: Annotated[
        Method, Query(description="Between two points, or of the nearest.")
    ] = Method.INTERPOLATED,
) -> CriticalValueAt:
    """Read a critical value off a boundary, with its uncertainty."""
    boundary = service.store.boundary(key)
    given = {name: text for name, text in request.query_params.multi_items() if name != "method"}
    return critical_value_at(boundary, {name: _number(name, text) for name, text in given.items()}, method)


def _number(name: str, text: str) -> float:
    try:
        return NUMBER.validate_strings(text)
    except ValidationError:
        raise BadInput(f"{name}: {text!r} — must be a finite number") from None
