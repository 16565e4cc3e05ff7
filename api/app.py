"""The application: routes, and what every request passes through."""

from __future__ import annotations

from http import HTTPStatus
from importlib.metadata import version

from fastapi import FastAPI
from prometheus_client import CollectorRegistry
from starlette.types import Lifespan

from api.http import problems
from api.http.body import BoundedBody
from api.http.headers import SafeHeaders
from api.http.metrics import JobMetrics, RequestMetrics
from api.http.openapi import complete
from api.http.page import add_page
from api.http.service import Service
from api.routes import boundaries, health, jobs, metrics, presets, runs
from ensemble.config.run_key import DISTRIBUTION

# What any route that asks who is there, or reads what was sent, may answer with.
REFUSALS = problems.documented(
    HTTPStatus.BAD_REQUEST,
    HTTPStatus.UNAUTHORIZED,
    HTTPStatus.FORBIDDEN,
    HTTPStatus.REQUEST_TIMEOUT,
    HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
    HTTPStatus.MISDIRECTED_REQUEST,
    HTTPStatus.UNPROCESSABLE_ENTITY,
    HTTPStatus.TOO_MANY_REQUESTS,
)


def create_app(service: Service, lifespan: Lifespan[FastAPI] | None = None) -> FastAPI:
    """Make the application that answers for a service."""
    app = FastAPI(
        title="Vesicle ensemble",
        version=version(DISTRIBUTION),
        description="When do two adhering vesicles stay together in a flow?  Jobs, runs and boundaries.",
        # The interactive pages load their scripts from elsewhere; the description itself is served.
        docs_url=None,
        redoc_url=None,
        lifespan=lifespan,
    )
    registry = CollectorRegistry()
    registry.register(JobMetrics(service.jobs))
    app.state.service = service
    app.state.registry = registry
    problems.install(app)
    for resource in (jobs, runs, boundaries, presets, metrics):
        app.include_router(resource.router, responses=REFUSALS)
    app.include_router(health.router)
    add_page(app)
    complete(app)
    settings = service.settings
    app.add_middleware(BoundedBody, most_bytes=settings.body_bytes, seconds=settings.body_seconds)
    app.add_middleware(SafeHeaders)
    app.add_middleware(RequestMetrics, registry=registry)
    return app
