"""What operators and their monitoring ask: whether the service is up and ready, and its metrics."""

from __future__ import annotations

from collections.abc import Iterator
from http import HTTPStatus
from threading import Lock

from cachetools import TTLCache
from fastapi import APIRouter, Request, Response
from fastapi.responses import PlainTextResponse
from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from prometheus_client.metrics_core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector
from pydantic import BaseModel
from sqlalchemy.exc import SQLAlchemyError

from api.database.service_database import read_in_thread
from api.http.problems import documented, unavailable
from api.jobs.job import JobStatus
from api.jobs.job_queue import Jobs
from api.routes.service import Reader, Service, service_of
from ensemble.disk import require_space

COUNT_SECONDS = 5.0  # for which the numbers of jobs are kept: to count a million of them takes 0.1 s

health_router = APIRouter(tags=["operations"])
metrics_router = APIRouter(tags=["operations"])


class Health(BaseModel):
    """State of the service."""

    status: str


class JobMetrics(Collector):
    """Number of jobs by status, read from the database when Prometheus asks, but not too often.

    Parameters
    ----------
    jobs : Jobs
    """

    def __init__(self, jobs: Jobs) -> None:
        self._jobs = jobs
        self._counts: TTLCache[str, dict[JobStatus, int]] = TTLCache(1, ttl=COUNT_SECONDS)
        self._counting = Lock()

    def collect(self) -> Iterator[Metric]:
        """Read the number of jobs of each status.

        Yields
        ------
        Metric
        """
        (family,) = self.describe()
        with self._counting:
            counts = self._counts.get("jobs")
            if counts is None:
                counts = self._counts["jobs"] = self._jobs.counts()
        for status, count in counts.items():
            family.add_metric((status,), count)
        yield family

    def describe(self) -> list[GaugeMetricFamily]:
        """Return the metric without values, so that registering it does not read the database."""
        return [GaugeMetricFamily("ensemble_jobs", "Jobs by status.", labels=("status",))]


@health_router.get("/healthz")
async def check_alive() -> Health:
    """Answer as long as the process runs."""
    return Health(status="alive")


@health_router.get("/readyz", responses=documented(HTTPStatus.SERVICE_UNAVAILABLE))
async def check_ready(request: Request) -> Health:
    """Answer with 200 if the store and the database of jobs can be read and written to, else with 503.

    Parameters
    ----------
    request : Request

    Returns
    -------
    Health

    Raises
    ------
    Problem
        If either cannot be read, or the disk is full.
    """
    service = service_of(request)
    try:
        await read_in_thread(_use_all, service)
    except (SQLAlchemyError, TimeoutError) as error:
        raise unavailable("the store or the database cannot be read") from error
    except OSError as error:
        raise unavailable(f"the store cannot be written to ({error.strerror})") from error
    return Health(status="ready")


def _use_all(service: Service) -> None:
    """Read both databases and write to the disk; what does not work raises its error."""
    service.jobs.records.page(limit=1)
    service.store.boundaries_page(limit=1)
    require_space(service.store.path)


@metrics_router.get("/metrics", response_class=PlainTextResponse)
def get_metrics(request: Request, reader: Reader) -> Response:
    """Give metrics in the text format of Prometheus: requests, their times, and jobs by status.

    Parameters
    ----------
    request : Request
    reader : Caller

    Returns
    -------
    Response
    """
    registry: CollectorRegistry = request.app.state.registry
    return Response(generate_latest(registry), media_type=CONTENT_TYPE_LATEST)
