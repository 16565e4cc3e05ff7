"""Certification of a converged search: both ends of its bracket are run again at finer numerics.

What finer means is in `ensemble.config.certifying_scene`.  An end that does not come out on its side again is
moved outward, one value of the grid at a time and at the finer numerics, until one does.  The bracket only
ever widens, so it holds the critical value at both numerics.  Each end depends only on the outcomes of the
values that it has passed.  So the certified bracket, like that of the search, depends on the physics alone.

Pure: no MPI, no files, no clock.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum
from itertools import takewhile

from ensemble.config.geometric_grid import GeometricGrid
from ensemble.search.critical_value import SearchStatus, Side


class CertificationResult(StrEnum):
    """What a certification has come to; it is the status of its point.

    Attributes
    ----------
    CERTIFYING
        An end has not been confirmed yet.
    CONVERGED
        Both ends have been confirmed, where they were or farther out.
    NON_MONOTONE
        Both have, but between them the finer numerics put a high below a low.
    UNCERTIFIED
        Up to the limits there is no value at which one of the ends could be confirmed.
    """

    CERTIFYING = "certifying"
    CONVERGED = SearchStatus.CONVERGED
    NON_MONOTONE = SearchStatus.NON_MONOTONE
    UNCERTIFIED = "uncertified"


class Certification:
    """The bracket of a converged search, tried at finer numerics.

    Parameters
    ----------
    grid : GeometricGrid
        That of the search.
    limits : (float, float)
        Those of the search.
    bracket : (float, float)
        Two values on the grid, within the limits.
    """

    def __init__(
        self, grid: GeometricGrid, limits: tuple[float, float], bracket: tuple[float, float]
    ) -> None:
        indices = grid.within(*limits)
        low, high = map(grid.index, bracket)
        self._grid = grid
        self._outward = {
            Side.LOW: range(low, indices[0] - 1, -1),
            Side.HIGH: range(high, indices[-1] + 1),
        }
        self._sides: dict[int, Side] = {}
        self._pending: set[int] = set()

    def ask(self) -> float | None:
        """Return a value to try now and mark it as pending; None if there is none."""
        for index in self._needed():
            if index not in self._pending:
                self._pending.add(index)
                return self._grid.value(index)
        return None

    def tell(self, value: float, side: Side) -> None:
        """Take the answer at the finer numerics for a value, whether or not it was asked for.

        Parameters
        ----------
        value : float
            On the grid.
        side : Side
            On which it lies at the finer numerics.

        Raises
        ------
        ValueError
            If the value is not on the grid.
        """
        index = self._grid.index(value)
        self._pending.discard(index)
        self._sides[index] = side

    def withdraw(self, value: float) -> None:
        """Give back a pending value whose run was cancelled or lost; it may be asked for again.

        Parameters
        ----------
        value : float
            A pending one.
        """
        self._pending.remove(self._grid.index(value))

    def unneeded(self) -> frozenset[float]:
        """Return the pending values whose answers are no longer needed."""
        return frozenset(map(self._grid.value, self._pending.difference(self._needed())))

    @property
    def ends_left(self) -> int:
        """How many ends are not confirmed yet."""
        return len(list(self._needed()))

    @property
    def bracket(self) -> tuple[float, float] | None:
        """The two values at which the ends have been confirmed; None until both have."""
        low, high = self._reached(Side.LOW), self._reached(Side.HIGH)
        if low is None or high is None or self.ends_left:
            return None
        return self._grid.value(low), self._grid.value(high)

    @property
    def result(self) -> CertificationResult:
        """What the certification has come to."""
        if self.ends_left:
            return CertificationResult.CERTIFYING
        if self.bracket is None:
            return CertificationResult.UNCERTIFIED
        contradictory = Side.HIGH in self._passed(Side.LOW) and Side.LOW in self._passed(Side.HIGH)
        return CertificationResult.NON_MONOTONE if contradictory else CertificationResult.CONVERGED

    @property
    def done(self) -> bool:
        """Whether no further answer is needed."""
        return self.result is not CertificationResult.CERTIFYING

    def _reached(self, side: Side) -> int | None:
        """How far out an end has come: the first index that is not known to be on another side."""
        return next((index for index in self._outward[side] if self._sides.get(index, side) is side), None)

    def _needed(self) -> Iterator[int]:
        """Where the ends have come, as far as not known; nothing once one of them has left the limits."""
        reached = [self._reached(side) for side in self._outward]
        if None not in reached:
            yield from (index for index in reached if index is not None and index not in self._sides)

    def _passed(self, side: Side) -> set[Side]:
        """On which sides the finer numerics put the values that an end has passed."""
        sides = (self._sides.get(index, side) for index in self._outward[side])
        return set(takewhile(lambda other: other is not side, sides))
