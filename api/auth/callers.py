"""Who asks, and what they may do."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from http import HTTPStatus
from ipaddress import ip_address
from typing import Annotated
from urllib.parse import urlsplit

from fastapi import Depends, Request
from fastapi.openapi.models import HTTPBearer
from fastapi.security.base import SecurityBase
from fastapi.security.utils import get_authorization_scheme_param

from api.auth.scope import Scope
from api.http.problems import Problem
from api.http.service import Service, service_of

LOCAL_USER = "local"
LOOPBACK_NAMES = {"localhost", "127.0.0.1", "::1"}
MOST_HOSTS = 64  # whose judgment is kept: clients of one service write few


@dataclass(frozen=True)
class Caller:
    """Somebody whose request is answered, and the service that answers."""

    user: str
    scope: Scope
    service: Service


def is_loopback(host: str) -> bool:
    """Tell whether an address to listen at is reached from this machine alone."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


@lru_cache(MOST_HOSTS)
def _names_loopback(host: str) -> bool:
    """Tell whether a Host header, which may have a port, names this machine."""
    try:
        return urlsplit(f"//{host}").hostname in LOOPBACK_NAMES
    except ValueError:  # brackets that hold no address
        return False


class Allowed(SecurityBase):
    """The dependency that lets only those pass whose scope includes this one, at a bounded rate.

    It is one and not a chain of several, as every request passes it: a link costs as much as a look-up.
    """

    def __init__(self, scope: Scope) -> None:
        self.model = HTTPBearer(description="A token made by `ensemble token create`.")
        self.scheme_name = "HTTPBearer"
        self._scope = scope

    async def __call__(self, request: Request) -> Caller:
        """Say who asks."""
        caller = await _identify(request, service_of(request))
        if not caller.scope.includes(self._scope):
            raise Problem(
                HTTPStatus.FORBIDDEN,
                f"Authorization: needs scope {self._scope}, the token has {caller.scope}",
            )
        await caller.service.limits.check_rate(caller.user)
        return caller


async def _identify(request: Request, service: Service) -> Caller:
    """Say who asks; a service without tokens answers whoever reaches it on this machine."""
    if not service.needs_tokens:
        # A page of another site that has its name point here would send that name.
        if not _names_loopback(request.headers.get("host", "")):
            raise Problem(
                HTTPStatus.MISDIRECTED_REQUEST, "Host: this service answers to localhost and 127.0.0.1 only"
            )
        return Caller(LOCAL_USER, Scope.ADMIN, service)
    address = request.client.host if request.client else ""
    await service.limits.check_refusals(address)
    kind, credentials = get_authorization_scheme_param(request.headers.get("Authorization"))
    shown = kind.lower() == "bearer" and bool(credentials)
    token = await service.look_up(service.tokens.find, credentials) if shown else None
    if token is None:
        if shown:
            await service.limits.count_refusal(address)
        raise Problem(
            HTTPStatus.UNAUTHORIZED,
            "Authorization: give a valid token as Bearer; it may be unknown or expired",
            headers={"WWW-Authenticate": "Bearer"},
        )
    return Caller(token.user, token.scope, service)


Reader = Annotated[Caller, Depends(Allowed(Scope.READ))]
Submitter = Annotated[Caller, Depends(Allowed(Scope.SUBMIT))]
