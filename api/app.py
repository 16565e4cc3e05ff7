"""The ASGI application: all routes, and the middleware that every request passes through."""

from __future__ import annotations

from http import HTTPStatus
from importlib.metadata import version

from fastapi import FastAPI
from prometheus_client import CollectorRegistry
from pydantic import BaseModel
from pydantic.json_schema import JsonSchemaMode
from starlette.middleware.gzip import DEFAULT_EXCLUDED_CONTENT_TYPES, GZipMiddleware
from starlette.types import Lifespan

from api.http import problems
from api.http.middleware import BodyLimits, Pieces, RequestMetrics, SecurityHeaders, StoppedRequests
from api.http.openapi import add_models, shorten_descriptions
from api.jobs.job import NoSuchJob
from api.jobs.submissions import Submission
from api.routes import (
    boundaries,
    flows,
    jobs,
    kinds,
    maps,
    operations,
    presets,
    reports,
    runs,
    unfinished_runs,
)
from api.routes.operations import JobMetrics
from api.routes.service import Service
from api.routes.web_page import add_web_page
from ensemble.config.run_key import DISTRIBUTION
from ensemble.store import NotStored
from ensemble.store.run_record import RunSummary

COMPRESSED_BYTES = 1000  # shorter answers are sent as they are
# Problems that every route with authentication or parameters may answer with.
COMMON_PROBLEMS = problems.documented(
    HTTPStatus.BAD_REQUEST,
    HTTPStatus.UNAUTHORIZED,
    HTTPStatus.FORBIDDEN,
    HTTPStatus.REQUEST_TIMEOUT,
    HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
    HTTPStatus.MISDIRECTED_REQUEST,
    HTTPStatus.UNPROCESSABLE_ENTITY,
    HTTPStatus.TOO_MANY_REQUESTS,
    HTTPStatus.SERVICE_UNAVAILABLE,
)

# Routes read submissions and write problems without FastAPI's help. Runs may hold numbers that are not
# finite, which FastAPI does not describe.
DESCRIBED_MODELS: tuple[tuple[type[BaseModel], JsonSchemaMode], ...] = (
    (problems.ProblemDocument, "serialization"),
    (Submission, "validation"),
    (RunSummary, "serialization"),
)


def create_app(service: Service, lifespan: Lifespan[FastAPI] | None = None) -> FastAPI:
    """Return the application of a service.

    Parameters
    ----------
    service : Service
        Its parts, which must stay open as long as the application runs.
    lifespan : callable, optional
        Context manager that is entered when the application starts, as Starlette defines it.

    Returns
    -------
    FastAPI
    """
    app = FastAPI(
        title="Vesicle ensemble",
        version=version(DISTRIBUTION),
        description="When do two adhering vesicles stay together in a flow? Jobs, runs and boundaries.",
        # The interactive documentation would load scripts from other sites. The description is served.
        docs_url=None,
        redoc_url=None,
        lifespan=lifespan,
    )
    registry = CollectorRegistry()
    registry.register(JobMetrics(service.jobs))
    app.state.service = service
    app.state.registry = registry
    problems.install_handlers(app, missing=(NotStored, NoSuchJob))
    for router in (
        jobs.router,
        runs.router,
        unfinished_runs.router,
        boundaries.router,
        maps.router,
        presets.router,
        kinds.router,
        flows.router,
        reports.router,
        operations.metrics_router,
    ):
        app.include_router(router, responses=COMMON_PROBLEMS)
    app.include_router(operations.health_router)
    add_web_page(app)
    shorten_descriptions(app)
    add_models(app, DESCRIBED_MODELS)
    settings = service.settings
    app.add_middleware(StoppedRequests)
    # Higher levels compress hardly better and take longer than to send what they save.
    app.add_middleware(
        GZipMiddleware,
        minimum_size=COMPRESSED_BYTES,
        compresslevel=1,
        exclude_content_types=(*DEFAULT_EXCLUDED_CONTENT_TYPES, runs.BINARY),
    )
    app.add_middleware(BodyLimits, maximum_bytes=settings.body_bytes, seconds=settings.body_seconds)
    app.add_middleware(SecurityHeaders)
    app.add_middleware(Pieces)
    app.add_middleware(RequestMetrics, registry=registry)
    return app
