"""Bounds on what one user, or one address, may ask for in a while."""

from __future__ import annotations

import math
import time
from http import HTTPStatus

from limits import RateLimitItem, parse
from limits.aio.storage import MemoryStorage
from limits.aio.strategies import FixedWindowRateLimiter

from api.http.problems import Problem


class RateLimits:
    """Counts requests of users, and refused tokens by address.

    Parameters
    ----------
    request_rate, refusal_rate : str
        As the library `limits` reads them, such as ``100/second``.
    """

    def __init__(self, request_rate: str, refusal_rate: str) -> None:
        self._requests = parse(request_rate)
        self._refusals = parse(refusal_rate)
        self._limiter = FixedWindowRateLimiter(MemoryStorage())

    async def check_rate(self, user: str) -> None:
        """Count a request, and refuse it if its user has made too many."""
        if not await self._limiter.hit(self._requests, "user", user):
            await self._refuse(self._requests, "user", user)

    async def check_refusals(self, address: str) -> None:
        """Refuse an address from which too many bad tokens came."""
        if not await self._limiter.test(self._refusals, "address", address):
            await self._refuse(self._refusals, "address", address)

    async def count_refusal(self, address: str) -> None:
        """Count a bad token from an address."""
        await self._limiter.hit(self._refusals, "address", address)

    async def _refuse(self, item: RateLimitItem, *identifiers: str) -> None:
        reset = (await self._limiter.get_window_stats(item, *identifiers)).reset_time
        wait = max(math.ceil(reset - time.time()), 1)
        raise Problem(
            HTTPStatus.TOO_MANY_REQUESTS,
            f"more than {item} for this {identifiers[0]}; try again in {wait} s",
            headers={"Retry-After": str(wait)},
        )
