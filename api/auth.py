"""Who asks, and what they may do."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from http import HTTPStatus
from ipaddress import ip_address
from typing import Annotated

from fastapi import Depends, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from api.problems import Problem
from api.scope import Scope
from api.service import ServiceOf

LOCAL_USER = "local"
LOOPBACK_NAMES = {"localhost", "127.0.0.1", "::1"}

bearer = HTTPBearer(auto_error=False, description="A token made by `ensemble token create`.")
Bearer = Annotated[HTTPAuthorizationCredentials | None, Depends(bearer)]


@dataclass(frozen=True)
class Principal:
    """Somebody whose request is answered."""

    user: str
    scope: Scope


def is_loopback(host: str) -> bool:
    """Tell whether an address to listen at is reached from this machine alone."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


async def identify(request: Request, service: ServiceOf, credentials: Bearer) -> Principal:
    """Say who asks; a service without tokens answers whoever reaches it on this machine."""
    if not service.needs_tokens:
        # A page of another site that has its name point here would send that name.
        if request.url.hostname not in LOOPBACK_NAMES:
            raise Problem(
                HTTPStatus.MISDIRECTED_REQUEST, "Host: this service answers to localhost and 127.0.0.1 only"
            )
        return Principal(LOCAL_USER, Scope.ADMIN)
    address = request.client.host if request.client else ""
    await service.limits.check_refusals(address)
    token = None
    if credentials is not None:
        token = await run_in_threadpool(service.tokens.find, credentials.credentials)
    if token is None:
        if credentials is not None:
            await service.limits.count_refusal(address)
        raise Problem(
            HTTPStatus.UNAUTHORIZED,
            "Authorization: give a valid token as Bearer; it may be unknown or expired",
            headers={"WWW-Authenticate": "Bearer"},
        )
    return Principal(token.user, token.scope)


def allowed(scope: Scope) -> Callable[..., Awaitable[Principal]]:
    """Make the dependency that lets only those pass whose scope includes this one, at a bounded rate."""

    async def pass_if_allowed(
        service: ServiceOf, principal: Annotated[Principal, Depends(identify)]
    ) -> Principal:
        if not principal.scope.includes(scope):
            raise Problem(
                HTTPStatus.FORBIDDEN, f"Authorization: needs scope {scope}, the token has {principal.scope}"
            )
        await service.limits.check_rate(principal.user)
        return principal

    return pass_if_allowed


Reader = Annotated[Principal, Depends(allowed(Scope.READ))]
Submitter = Annotated[Principal, Depends(allowed(Scope.SUBMIT))]
