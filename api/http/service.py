"""What a request needs from the application, and how a route gets it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ParamSpec, TypeVar

from cachetools import TTLCache
from fastapi import Request
from fastapi.concurrency import run_in_threadpool

from api.auth.tokens import Tokens
from api.http.rate_limits import RateLimits
from api.jobs.job_queue import Jobs
from api.jobs.submissions import Submissions
from api.settings import Settings
from ensemble.store import Record, Store

Arguments = ParamSpec("Arguments")
Found = TypeVar("Found")


@dataclass(frozen=True)
class Service:
    """The parts of a running service.

    Without `needs_tokens` it answers everybody who reaches it, which must be this machine alone.  `embedded`
    says that its databases are files, not servers.  `watched` are jobs that somebody listens to, as they were
    a moment ago.
    """

    settings: Settings
    store: Store
    jobs: Jobs
    submissions: Submissions
    watched: TTLCache[str, Record]
    tokens: Tokens
    limits: RateLimits
    needs_tokens: bool
    embedded: bool

    async def look_up(
        self, find: Callable[Arguments, Found], *arguments: Arguments.args, **named: Arguments.kwargs
    ) -> Found:
        """Find something by its key.

        A file is read in less time than it takes to ask another thread to; a server may keep one waiting.
        """
        if self.embedded:
            return find(*arguments, **named)
        return await run_in_threadpool(find, *arguments, **named)


def service_of(request: Request) -> Service:
    """Return the service that a request came to."""
    service: Service = request.app.state.service
    return service
