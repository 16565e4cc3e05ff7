"""How many streams of events each user has open: each takes a connection for as long as its job lasts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus

from api.http.problems import Problem


class OpenStreams:
    """Counts of open streams by user. Call it from the event loop only.

    Parameters
    ----------
    most : int
        Streams that one user may have open.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._counts: Counter[str] = Counter()

    @contextmanager
    def counted(self, user: str) -> Iterator[None]:
        """Count a stream of a user as open as long as the block runs.

        Parameters
        ----------
        user : str

        Raises
        ------
        Problem
            If the user has as many open as one may have.
        """
        if self._counts[user] >= self._most:
            raise Problem(
                HTTPStatus.TOO_MANY_REQUESTS,
                f"events: this user has {self._most} streams open, and there may not be more; close one",
            )
        self._counts[user] += 1
        try:
            yield
        finally:
            self._counts[user] -= 1
            if not self._counts[user]:
                del self._counts[user]
