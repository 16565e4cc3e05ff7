"""Authentication: which user makes a request, and with which scope."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from http import HTTPStatus
from ipaddress import IPv6Address, ip_address, ip_network
from urllib.parse import urlsplit

from fastapi import Request
from fastapi.security.utils import get_authorization_scheme_param

from api.auth import TokenScope
from api.auth.tokens import Token, Tokens
from api.database.service_database import LookUp
from api.http.problems import Problem
from api.http.rate_limits import RateLimits

LOCAL_USER = "local"
CACHED_HOSTS = 64  # Host headers whose check is cached: the clients of one service send few different ones
LONGEST_HOST = 300  # characters; a name of DNS has at most 253
# Headers by which proxies say that they pass a request on, besides all that begin with X-Forwarded.
_FORWARDING_HEADERS = frozenset(
    {"forwarded", "via", "x-real-ip", "x-client-ip", "x-cluster-client-ip", "true-client-ip"}
    | {"cf-connecting-ip", "fastly-client-ip", "x-original-host", "x-original-forwarded-for"}
)
_OWN_SITE = ("same-origin", "none")  # none: the user typed the address or opened a bookmark
_NETWORK_OF_A_CLIENT = 64  # bits of the prefix that a user of IPv6 has for all of his addresses


@dataclass(frozen=True)
class Identity:
    """The user who makes a request, and the scope that the request has.

    Attributes
    ----------
    user : str
    scope : TokenScope
    token : str or None
        The `id` of the token; None for a user of this machine who needs none.
    """

    user: str
    scope: TokenScope
    token: str | None


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
        return is_loopback(urlsplit(f"//{host}").hostname or "")
    except ValueError:  # invalid brackets
        return False


class Authentication:
    """Identifies users by their tokens and limits the rate of their requests.

    A service that has never had a token takes every request of this machine for one of an administrator.

    Parameters
    ----------
    tokens : Tokens
    limits : RateLimits
    look_up : LookUp
        How tokens are read from the database.
    """

    def __init__(self, tokens: Tokens, limits: RateLimits, look_up: LookUp) -> None:
        self._tokens = tokens
        self._limits = limits
        self._look_up = look_up
        self._token_has_existed = False

    async def is_required(self) -> bool:
        """Tell whether requests need a token: from the first one on that has ever been created.

        Returns
        -------
        bool
        """
        if not self._token_has_existed:  # else it stays so
            self._token_has_existed = await self._look_up(self._tokens.have_existed)
        return self._token_has_existed

    async def authorize(self, request: Request, scope: TokenScope) -> Identity:
        """Identify the user of a request, count the request and check the scope.

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
            401 without a valid token, 403 if its scope does not suffice or a page of another site makes the
            request, 421 if a service without tokens is reached by a proxy or by a name that is not this
            machine's, 429 after too many requests or invalid tokens.
        """
        _refuse_other_sites(request)
        if await self.is_required():
            token = await self._token(request)
            identity = Identity(token.user, token.scope, token.id)
        else:
            _require_this_machine(request)
            identity = Identity(LOCAL_USER, TokenScope.ADMIN, None)
        await self._limits.count_request(identity.user)
        if not identity.scope.includes(scope):
            raise Problem(
                HTTPStatus.FORBIDDEN,
                f"Authorization: needs scope {scope}, the token has {identity.scope}",
            )
        return identity

    async def is_valid(self, identity: Identity) -> bool:
        """Tell whether a user who was identified earlier would still be let in.

        Parameters
        ----------
        identity : Identity

        Returns
        -------
        bool
            False after the token has been revoked or has expired, and for a user without one once the
            service needs tokens.
        """
        if identity.token is None:
            return not await self.is_required()
        return await self._look_up(self._tokens.is_valid, identity.token)

    async def _token(self, request: Request) -> Token:
        """Return the token of a request."""
        scheme, credentials = get_authorization_scheme_param(request.headers.get("Authorization"))
        if scheme.lower() == "bearer" and credentials:
            token = await self._look_up(self._tokens.find, credentials)
            if token is not None:  # whatever others have sent from this address
                return token
            await self._limits.count_invalid_token(_client(request))
        raise Problem(
            HTTPStatus.UNAUTHORIZED,
            "Authorization: give a valid token as Bearer; it may be unknown or expired",
            headers={"WWW-Authenticate": "Bearer"},
        )


def _refuse_other_sites(request: Request) -> None:
    """Refuse requests of pages of other sites: they cannot read the answer, but make the service work."""
    site = request.headers.get("sec-fetch-site")
    if site is not None and site not in _OWN_SITE:
        raise Problem(HTTPStatus.FORBIDDEN, f"Sec-Fetch-Site: {site[:20]!r} — must be same-origin or none")


def _require_this_machine(request: Request) -> None:
    """Refuse, in a service without tokens, all requests but those of programs and pages on this machine."""
    for name in request.headers:
        if name in _FORWARDING_HEADERS or name.startswith("x-forwarded-"):
            raise Problem(
                HTTPStatus.MISDIRECTED_REQUEST,
                f"{name}: a service without tokens does not answer requests that a proxy forwards; "
                "make a token with `ensemble token create`",
            )
    host = request.headers.get("host", "")
    # A web page of another site, whose name resolves to this machine, would send that name.
    if len(host) > LONGEST_HOST or not _names_loopback(host) or not is_loopback(_address(request)):
        raise Problem(
            HTTPStatus.MISDIRECTED_REQUEST,
            "Host: a service without tokens answers to localhost and loopback addresses only",
        )
    origin = request.headers.get("origin")
    # Browsers that know Sec-Fetch-Site have been checked by it, also behind a proxy that changes the host.
    if origin is not None and "sec-fetch-site" not in request.headers and origin != f"http://{host}":
        raise Problem(HTTPStatus.FORBIDDEN, "Origin: must be this service")


def _address(request: Request) -> str:
    return request.client.host if request.client else ""


def _client(request: Request) -> str:
    """Return the address of a client, or in IPv6 the network that is all his."""
    address = _address(request)
    try:
        parsed = ip_address(address)
    except ValueError:
        return address
    if isinstance(parsed, IPv6Address):
        return str(ip_network((parsed, _NETWORK_OF_A_CLIENT), strict=False))
    return address
