"""Looks at the collectives of a run without changing it."""

from __future__ import annotations

import time
from collections.abc import Callable

from solver.parallel import Array, Parallel, Shares, T


class Counted:
    """Ranks as others see them, with everything that is gathered counted.

    Attributes
    ----------
    gathers : int
    gathered_bytes : int
        In all of them, counting what all ranks contribute.
    seconds : float
        That this rank spent in them, waiting for others included.
    """

    def __init__(self, parallel: Parallel) -> None:
        self._parallel = parallel
        self.rank = parallel.rank
        self.size = parallel.size
        self.reset()

    def reset(self) -> None:
        """Count from zero."""
        self.gathers, self.gathered_bytes, self.seconds = 0, 0, 0.0

    def divide(self, rows: int, cost: Callable[[], Array] | None = None) -> Shares:
        """See `Parallel`."""
        return _CountedShares(self, self._parallel.divide(rows, cost))

    def agree(self, value: T) -> T:
        """See `Parallel`."""
        return self._parallel.agree(value)


class _CountedShares:
    def __init__(self, counted: Counted, shares: Shares) -> None:
        self._counted = counted
        self._shares = shares

    @property
    def own(self) -> slice:
        """See `Shares`."""
        return self._shares.own

    def gather(self, part: Array, axis: int = 0) -> Array:
        """See `Shares`."""
        begun = time.perf_counter()
        whole = self._shares.gather(part, axis)
        self._counted.seconds += time.perf_counter() - begun
        self._counted.gathers += 1
        self._counted.gathered_bytes += whole.nbytes
        return whole
