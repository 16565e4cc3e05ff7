"""Ranks that count what they gather."""

from __future__ import annotations

import time
from collections.abc import Callable

from solver.parallel import Array, Parallel, Shares, T


class CountingRanks:
    """Ranks that behave like others and count everything that is gathered; see `solver.parallel.Parallel`.

    Parameters
    ----------
    parallel : Parallel
        The ranks that do the work.

    Attributes
    ----------
    rank, size : int
        As of ``parallel``.
    gathers : int
        Number of collectives.
    gathered_bytes : int
        Bytes that all ranks contributed to them.
    seconds : float
        Time that this rank spent in them, including the time it waited for others.
    """

    def __init__(self, parallel: Parallel) -> None:
        self._parallel = parallel
        self.rank = parallel.rank
        self.size = parallel.size
        self.reset()

    def reset(self) -> None:
        """Set all counts to zero."""
        self.gathers, self.gathered_bytes, self.seconds = 0, 0, 0.0

    def divide(self, rows: int, cost: Callable[[], Array] | None = None) -> Shares:
        """Divide rows among the ranks.

        Parameters
        ----------
        rows : int
            Number of rows.
        cost : callable, optional
            Returns the costs of the rows, (rows,).

        Returns
        -------
        Shares
            The division.
        """
        return _CountingShares(self, self._parallel.divide(rows, cost))

    def agree(self, value: T) -> T:
        """Return the value of the first rank.

        Parameters
        ----------
        value : any
            The value of this rank.

        Returns
        -------
        any
            The same on all ranks.
        """
        return self._parallel.agree(value)


class _CountingShares:
    def __init__(self, ranks: CountingRanks, shares: Shares) -> None:
        self._ranks = ranks
        self._shares = shares

    @property
    def own(self) -> slice:
        return self._shares.own

    def gather(self, part: Array, axis: int = 0) -> Array:
        begin = time.perf_counter()
        whole = self._shares.gather(part, axis)
        self._ranks.seconds += time.perf_counter() - begin
        self._ranks.gathers += 1
        self._ranks.gathered_bytes += whole.nbytes
        return whole
