"""Authentication: which user makes a request, and with which scope."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from http import HTTPStatus
from ipaddress import ip_address
from urllib.parse import urlsplit

from fastapi import Request
from fastapi.security.utils import get_authorization_scheme_param

from api.auth import TokenScope
from api.auth.tokens import Token, Tokens
from api.database.service_database import LookUp
from api.http.problems import Problem
from api.http.rate_limits import RateLimits

LOCAL_USER = "local"
LOOPBACK_NAMES = {"localhost", "127.0.0.1", "::1"}
CACHED_HOSTS = 64  # Host headers whose check is cached: the clients of one service send few different ones


@dataclass(frozen=True)
class Identity:
    """The user who makes a request, and the scope that the request has."""

    user: str
    scope: TokenScope


def is_loopback(host: str) -> bool:
    """Tell whether only this machine reaches an address.

    Parameters
    ----------
    host : str
        IP address or host name to listen at.

    Returns
    -------
    bool
    """
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


@lru_cache(CACHED_HOSTS)
def _names_loopback(host: str) -> bool:
    """Tell whether a Host header, with or without a port, names this machine."""
    try:
        return urlsplit(f"//{host}").hostname in LOOPBACK_NAMES
    except ValueError:  # invalid brackets
        return False


class Authentication:
    """Identifies users by their tokens and limits the rate of their requests.

    Parameters
    ----------
    tokens : Tokens
    limits : RateLimits
    required : bool
        Whether requests need a token. Without, every request of this machine is one of an administrator.
    look_up : LookUp
        How tokens are read from the database.
    """

    def __init__(self, tokens: Tokens, limits: RateLimits, required: bool, look_up: LookUp) -> None:
        self.required = required
        self._tokens = tokens
        self._limits = limits
        self._look_up = look_up

    async def authorize(self, request: Request, scope: TokenScope) -> Identity:
        """Identify the user of a request, check the scope and count the request.

        Parameters
        ----------
        request : Request
        scope : TokenScope
            The scope that the request needs.

        Returns
        -------
        Identity

        Raises
        ------
        Problem
            401 without a valid token, 403 if its scope does not suffice, 421 if a service without tokens
            is reached by a name that is not this machine's, 429 after too many requests or invalid tokens.
        """
        identity = await self._identify(request)
        if not identity.scope.includes(scope):
            raise Problem(
                HTTPStatus.FORBIDDEN,
                f"Authorization: needs scope {scope}, the token has {identity.scope}",
            )
        await self._limits.count_request(identity.user)
        return identity

    async def _identify(self, request: Request) -> Identity:
        if not self.required:
            # A web page of another site, whose name resolves to this machine, would send that name.
            if not _names_loopback(request.headers.get("host", "")):
                raise Problem(
                    HTTPStatus.MISDIRECTED_REQUEST,
                    "Host: this service answers to localhost and 127.0.0.1 only",
                )
            return Identity(LOCAL_USER, TokenScope.ADMIN)
        token = await self._token(request)
        return Identity(token.user, token.scope)

    async def _token(self, request: Request) -> Token:
        """Return the token of a request."""
        address = request.client.host if request.client else ""
        await self._limits.check_address(address)
        scheme, credentials = get_authorization_scheme_param(request.headers.get("Authorization"))
        if scheme.lower() == "bearer" and credentials:
            token = await self._look_up(self._tokens.find, credentials)
            if token is not None:
                return token
            await self._limits.count_invalid_token(address)
        raise Problem(
            HTTPStatus.UNAUTHORIZED,
            "Authorization: give a valid token as Bearer; it may be unknown or expired",
            headers={"WWW-Authenticate": "Bearer"},
        )
