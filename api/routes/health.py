"""Whether the service is alive, and whether it can work."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import APIRouter, Request
from sqlalchemy.exc import SQLAlchemyError

from api.http.problems import Problem, documented
from api.http.schemas import Health
from api.http.service import service_of

router = APIRouter(tags=["health"])


@router.get("/healthz")
async def alive() -> Health:
    """Answer: the process lives."""
    return Health(status="alive")


@router.get("/readyz", responses=documented(HTTPStatus.SERVICE_UNAVAILABLE))
def ready(request: Request) -> Health:
    """Answer if the store and the database of jobs can be read."""
    service = service_of(request)
    try:
        service.jobs.counts()
        service.store.boundaries_page(limit=1)
    except SQLAlchemyError as error:
        raise Problem(HTTPStatus.SERVICE_UNAVAILABLE, "the store or the database cannot be read") from error
    return Health(status="ready")
