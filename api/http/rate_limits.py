"""Limits on how often a user may request and submit, and how many invalid tokens an address may send."""

from __future__ import annotations

import math
import time
from http import HTTPStatus

from limits import RateLimitItem, parse
from limits.aio.storage import MemoryStorage
from limits.aio.strategies import FixedWindowRateLimiter

from api.http.problems import Problem


class RateLimits:
    """Counts of requests and submissions by user, of invalid tokens by address, in this process's memory.

    Parameters
    ----------
    request_rate : str
        Largest rate of requests of one user, in the notation of the library `limits`: ``100/second``.
    submission_rate : str
        Largest rate of submissions of one user.
    invalid_token_rate : str
        Largest rate of invalid tokens from one address.
    """

    def __init__(self, request_rate: str, submission_rate: str, invalid_token_rate: str) -> None:
        self._requests = parse(request_rate)
        self._submissions = parse(submission_rate)
        self._invalid_tokens = parse(invalid_token_rate)
        self._limiter = FixedWindowRateLimiter(MemoryStorage())

    async def count_request(self, user: str) -> None:
        """Count a request of a user.

        Parameters
        ----------
        user : str

        Raises
        ------
        Problem
            If the user has made too many requests.
        """
        if not await self._limiter.hit(self._requests, "user", user):
            await self._refuse(self._requests, "user", user)

    async def count_submission(self, user: str) -> None:
        """Count a submission of a user.

        Parameters
        ----------
        user : str

        Raises
        ------
        Problem
            If the user has submitted too often.
        """
        if not await self._limiter.hit(self._submissions, "submitter", user):
            await self._refuse(self._submissions, "submitter", user)

    async def count_invalid_token(self, address: str) -> None:
        """Count an invalid token from an address.

        Parameters
        ----------
        address : str

        Raises
        ------
        Problem
            If too many came from there.
        """
        if not await self._limiter.hit(self._invalid_tokens, "address", address):
            await self._refuse(self._invalid_tokens, "address", address)

    async def _refuse(self, item: RateLimitItem, *identifiers: str) -> None:
        reset = (await self._limiter.get_window_stats(item, *identifiers)).reset_time
        wait = max(math.ceil(reset - time.time()), 1)
        raise Problem(
            HTTPStatus.TOO_MANY_REQUESTS,
            f"more than {item} for this {identifiers[0]}; try again in {wait} s",
            headers={"Retry-After": str(wait)},
        )
