"""What a request needs from the application, and how a route gets it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request

from api.jobs import Jobs
from api.limits import RateLimits
from api.settings import Settings
from api.tokens import Tokens
from ensemble.store import Store


@dataclass(frozen=True)
class Service:
    """The parts of a running service.

    Without `needs_tokens` it answers everybody who reaches it, which must be this machine alone.
    """

    settings: Settings
    store: Store
    jobs: Jobs
    tokens: Tokens
    limits: RateLimits
    needs_tokens: bool


async def service_of(request: Request) -> Service:
    """Return the service that a request came to."""
    service: Service = request.app.state.service
    return service


ServiceOf = Annotated[Service, Depends(service_of)]
