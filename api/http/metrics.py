"""What Prometheus is told: requests, how long they took, and how many jobs there are."""

from __future__ import annotations

import time
from collections.abc import Iterator

from prometheus_client import CollectorRegistry, Counter, Histogram
from prometheus_client.metrics_core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from api.jobs.job_queue import Jobs

UNKNOWN_PATH = "unknown"  # a label for each path that somebody makes up would have no end


class RequestMetrics:
    """Counts and times requests by method, route and status."""

    def __init__(self, app: ASGIApp, registry: CollectorRegistry) -> None:
        self._app = app
        self._requests = Counter(
            "ensemble_requests", "Requests answered.", ("method", "route", "status"), registry=registry
        )
        self._seconds = Histogram(
            "ensemble_request_seconds",
            "Time to the start of the answer.",
            ("method", "route"),
            registry=registry,
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        begun = time.perf_counter()

        async def send_counted(message: Message) -> None:
            if message["type"] == "http.response.start":
                route = getattr(scope.get("route"), "path", UNKNOWN_PATH)
                self._requests.labels(scope["method"], route, message["status"]).inc()
                self._seconds.labels(scope["method"], route).observe(time.perf_counter() - begun)
            await send(message)

        await self._app(scope, receive, send_counted)


class JobMetrics(Collector):
    """Counts jobs by status whenever it is asked."""

    def __init__(self, jobs: Jobs) -> None:
        self._jobs = jobs

    def collect(self) -> Iterator[Metric]:
        """Yield the number of jobs of each status."""
        family = GaugeMetricFamily("ensemble_jobs", "Jobs by status.", labels=("status",))
        for status, count in self._jobs.counts().items():
            family.add_metric((status,), count)
        yield family

    def describe(self) -> list[Metric]:
        """Say what it collects, without asking the database."""
        return [GaugeMetricFamily("ensemble_jobs", "Jobs by status.", labels=("status",))]
