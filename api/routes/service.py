"""The parts of the service that routes use, and the dependencies by which a route gets them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from cachetools import TTLCache
from fastapi import Depends, Request
from fastapi.openapi.models import HTTPBearer
from fastapi.security.base import SecurityBase

from api.auth import TokenScope
from api.auth.authentication import Authentication, Identity
from api.auth.tokens import Tokens
from api.database.service_database import LookUp
from api.http.open_streams import OpenStreams
from api.http.rate_limits import RateLimits
from api.jobs.expected_times import ExpectedTimes
from api.jobs.job_queue import Jobs
from api.jobs.submissions import Submissions
from api.results.downloads import Downloads
from api.settings import Settings
from ensemble.store import Record, Store


@dataclass(frozen=True)
class Service:
    """The parts of a running service.

    Attributes
    ----------
    settings : Settings
    store : Store
        Runs and boundaries.
    jobs : Jobs
        The queue of jobs.
    submissions : Submissions
        Checks submitted documents.
    expected_times : ExpectedTimes
        How long jobs are likely to take.
    downloads : Downloads
        Makes files of runs and boundaries.
    watched_jobs : TTLCache
        Recently read jobs by their identifiers, shared by all clients that listen to events.
    tokens : Tokens
    limits : RateLimits
    streams : OpenStreams
        Of events.
    authentication : Authentication
        Of requests, by the tokens.
    look_up : LookUp
        How coroutines read single records.
    """

    settings: Settings
    store: Store
    jobs: Jobs
    submissions: Submissions
    expected_times: ExpectedTimes
    downloads: Downloads
    watched_jobs: TTLCache[str, Record]
    tokens: Tokens
    limits: RateLimits
    streams: OpenStreams
    authentication: Authentication
    look_up: LookUp


@dataclass(frozen=True)
class Caller:
    """The user who makes a request, and the service that answers it."""

    identity: Identity
    service: Service

    @property
    def user(self) -> str:
        """Name of the user."""
        return self.identity.user

    @property
    def scope(self) -> TokenScope:
        """What the request allows."""
        return self.identity.scope

    async def is_valid(self) -> bool:
        """Tell whether the user would still be let in: a long answer ends with its token.

        Returns
        -------
        bool
        """
        return await self.service.authentication.is_valid(self.identity)


def service_of(request: Request) -> Service:
    """Return the service that answers a request.

    Parameters
    ----------
    request : Request

    Returns
    -------
    Service
    """
    service: Service = request.app.state.service
    return service


class RequiredScope(SecurityBase):
    """A dependency that authorizes a request and returns its `Caller`.

    It is one dependency and not a chain of several: every request resolves it, and each dependency of a chain
    costs as much as reading a record.

    Parameters
    ----------
    scope : TokenScope
        The scope that the route needs.
    """

    def __init__(self, scope: TokenScope) -> None:
        self.model = HTTPBearer(description="A token made by `ensemble token create`.")
        self.scheme_name = "HTTPBearer"
        self._scope = scope

    async def __call__(self, request: Request) -> Caller:
        """Authorize a request.

        Parameters
        ----------
        request : Request

        Returns
        -------
        Caller

        Raises
        ------
        Problem
            If the request is not authorized.
        """
        service = service_of(request)
        identity = await service.authentication.authorize(request, self._scope)
        return Caller(identity, service)


Reader = Annotated[Caller, Depends(RequiredScope(TokenScope.READ))]
Submitter = Annotated[Caller, Depends(RequiredScope(TokenScope.SUBMIT))]
