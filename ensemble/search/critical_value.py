"""Search for a critical value: where the outcome of runs changes side.  Pure: no MPI, no files, no clock.

The search hands out values to try (`CriticalValueSearch.ask`) and takes answers in any order
(`CriticalValueSearch.tell`).  Its final bracket depends only on the side of every value, not on how, by how
many workers or in which order the answers were found:

- Values lie on a grid.  Where all runs are decided the bracket ends as two neighbors on it.
- Runs without an answer (undecided, failed) are worked around.  The search approaches the zone where they
  lie from both sides.  It stops when `ZONE_EDGE` values in a row next to the largest low and next to the
  smallest high are known to give no answer, or when all between these two are known.  This assumes that
  there is at most one such row of that length or longer; shorter ones may lie anywhere.
- A low above a high contradicts a single critical value.  The search stops, and the bracket spans the
  contradiction: from the largest low with no high at or below it to the smallest high with no low above it.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Protocol

from ensemble.config.geometric_grid import GeometricGrid

# Numerical failures may be isolated, so one of them is not yet the edge of a zone without answers.
ZONE_EDGE = 3


class Side(StrEnum):
    """On which side of the critical value an outcome lies; `UNDECIDED` and `FAILED` tell nothing about it."""

    LOW = "low"
    HIGH = "high"
    UNDECIDED = "undecided"
    FAILED = "failed"


class SearchStatus(StrEnum):
    """What a search has come to.

    Attributes
    ----------
    SEARCHING
        There are values left whose answers are needed.
    CONVERGED
        The bracket is two neighbors on the grid.
    UNDECIDED, FAILED
        The bracket cannot converge because runs between its ends are undecided or (next to an end) failed.
    NON_MONOTONE
        A low lies above a high.
    UNBRACKETED
        All values within the limits lie on one side.
    """

    SEARCHING = "searching"
    CONVERGED = "converged"
    UNDECIDED = "undecided"
    FAILED = "failed"
    NON_MONOTONE = "non-monotone"
    UNBRACKETED = "unbracketed"


class _Prior(Protocol):
    """Where the critical value is expected, as a probability distribution over grid indices."""

    def weight(self, low: int, high: int) -> float:
        """Return the probability, up to a factor, of the interval between two indices."""

    def median(self, low: int, high: int) -> float:
        """Return the point that halves this probability."""


class _UniformPrior:
    """All indices are equally likely.  Halving the probability is bisection."""

    def weight(self, low: int, high: int) -> float:
        return high - low

    def median(self, low: int, high: int) -> float:
        return (low + high) / 2


@dataclass(frozen=True)
class _CauchyPrior:
    """A Cauchy distribution with its quartiles at the ends of a guess.

    Halving its probability tries the middle of the guess, then the end on the side of the answer.  If the
    guess was right, it then bisects within the guess; if not, it doubles the distance from it.  With offsets
    d from the center, the distribution function is the angle of the vector (half_width, d).  Sums of unit
    vectors keep their accuracy where differences of arctangents lose it.
    """

    center: float
    half_width: float

    def weight(self, low: int, high: int) -> float:
        below, above = low - self.center, high - self.center
        return math.atan2(self.half_width * (above - below), self.half_width**2 + below * above)

    def median(self, low: int, high: int) -> float:
        below, above = low - self.center, high - self.center
        norm_below, norm_above = math.hypot(self.half_width, below), math.hypot(self.half_width, above)
        tangent = (below / norm_below + above / norm_above) / (1 / norm_below + 1 / norm_above)
        return self.center + tangent


def indices_within(grid: GeometricGrid, limits: tuple[float, float]) -> range:
    """Return the indices of the values that a search may try.

    Parameters
    ----------
    grid : GeometricGrid
        That of the search.
    limits : (float, float)
        Those of the search.

    Returns
    -------
    range
        At least two.

    Raises
    ------
    ValueError
        If they are not 0 < low < high, or hold fewer than two values.
    """
    low, high = limits
    if not 0 < low < high < math.inf:
        raise ValueError(f"limits: [{low}, {high}] — must be 0 < low < high")
    indices = grid.within(low, high)
    if indices.stop - indices.start < 2:
        raise ValueError(f"limits: [{low}, {high}] — hold no two values {grid.tolerance} apart")
    return indices


class GridSearch:
    """The values of a grid within limits, what is known of them, and which of them are being tried.

    Parameters
    ----------
    grid : GeometricGrid
        The values that may be tried.
    limits : (float, float)
        Least and greatest value that may be tried, 0 < low < high.

    Raises
    ------
    ValueError
        If fewer than two grid values lie within the limits.
    """

    def __init__(self, grid: GeometricGrid, limits: tuple[float, float]) -> None:
        self._grid = grid
        self._indices = indices_within(grid, limits)
        self._sides: dict[int, Side] = {}
        self._pending: set[int] = set()

    def tell(self, value: float, side: Side) -> None:
        """Take the answer for a value, whether or not it was asked for.

        Parameters
        ----------
        value : float
            On the grid, within the limits.
        side : Side
            On which it lies.

        Raises
        ------
        ValueError
            If the value is not on the grid or outside the limits, or is known to lie on another side.
        """
        index = self._index(value)
        known = self._sides.setdefault(index, side)
        if known is not side:
            raise ValueError(f"{value!r} cannot be {side}: it is known to be {known}")
        self._pending.discard(index)

    def side_at(self, value: float) -> Side:
        """Return the side on which a value lies.

        Parameters
        ----------
        value : float
            Whose answer is known.

        Returns
        -------
        Side
        """
        return self._sides[self._index(value)]

    def revise(self, sides: Mapping[float, Side]) -> None:
        """Take better answers for values that are known, in place of the former ones.

        Parameters
        ----------
        sides : mapping from float to Side
            By value.
        """
        self._sides |= {self._index(value): side for value, side in sides.items()}

    def withdraw(self, value: float) -> None:
        """Give back a pending value whose run was cancelled or lost; it may be asked for again.

        Parameters
        ----------
        value : float
            A pending one.

        Raises
        ------
        ValueError
            If the value is not pending.
        """
        index = self._index(value)
        if index not in self._pending:
            raise ValueError(f"{value!r} is not pending")
        self._pending.remove(index)

    def _index(self, value: float) -> int:
        index = self._grid.index(value)
        if index not in self._indices:
            first, last = self._grid.value(self._indices[0]), self._grid.value(self._indices[-1])
            raise ValueError(f"{value!r} is outside the limits [{first}, {last}]")
        return index

    def _try(self, index: int) -> float:
        """Mark a value as pending and return it."""
        self._pending.add(index)
        return self._grid.value(index)

    def _values(self, low: int, high: int) -> tuple[float | None, float | None]:
        """Return the values of two indices; None for one beyond the limits."""
        return (
            self._grid.value(low) if low in self._indices else None,
            self._grid.value(high) if high in self._indices else None,
        )

    def _guessed(self, guess: tuple[float, float]) -> tuple[float, float]:
        """Return where the ends of a guess lie on the grid; they need not lie within the limits."""
        low, high = guess
        if not 0 < low <= high < math.inf:
            raise ValueError(f"guess: [{low}, {high}] — must be 0 < low <= high")
        return self._grid.position(low), self._grid.position(high)


class CriticalValueSearch(GridSearch):
    """The search for a critical value on a grid, within limits.

    Parameters
    ----------
    grid : GeometricGrid
        The values that may be tried.
    limits : (float, float)
        Least and greatest value that may be tried, 0 < low < high.
    guess : (float, float), optional
        Where the critical value is expected.  It decides only what is tried first; it may be wrong.

    Raises
    ------
    ValueError
        If fewer than two grid values lie within the limits, or the guess is not 0 < low <= high.
    """

    def __init__(
        self, grid: GeometricGrid, limits: tuple[float, float], guess: tuple[float, float] | None = None
    ) -> None:
        super().__init__(grid, limits)
        self._prior: _Prior = _UniformPrior() if guess is None else self._prior_of(guess)

    def copy(self) -> CriticalValueSearch:
        """Return a search that has come as far as this one and goes on without it."""
        other = copy.copy(self)
        other._sides, other._pending = dict(self._sides), set(self._pending)
        return other

    def ask(self) -> float | None:
        """Return the most useful value to try now and mark it as pending.

        Of all values that may narrow the bracket it is the one that halves the most probable interval
        between values that are known or pending.  For a single worker that is bisection.  For several it
        minimizes the interval that is expected to remain after all pending answers.

        Returns
        -------
        float or None
            None if no value is useful now.
        """
        gaps = [gap for region in self._regions() for gap in self._between_pending(*region)]
        if not gaps:
            return None
        low, high = max(gaps, key=lambda gap: self._prior.weight(*gap))
        index = min(max(round(self._prior.median(low, high)), low + 1), high - 1)
        return self._try(index)

    def replace_guess(self, guess: tuple[float, float]) -> None:
        """Replace the guess.

        Parameters
        ----------
        guess : (float, float)
            Where the critical value is expected.

        Raises
        ------
        ValueError
            If the guess is not 0 < low <= high.
        """
        self._prior = self._prior_of(guess)

    def unneeded(self) -> frozenset[float]:
        """Return the pending values whose answers can no longer narrow the bracket."""
        low, high = self.ends()
        done = self.done
        return frozenset(self._grid.value(index) for index in self._pending if done or not low < index < high)

    @property
    def bracket(self) -> tuple[float | None, float | None]:
        """The largest value known to be low and the smallest known to be high; None where unknown."""
        return self._values(*self.ends())

    @property
    def contradictions(self) -> tuple[float, ...]:
        """The lows above a high and the highs below a low, ascending; empty unless non-monotone."""
        low, high = self.ends()
        return tuple(
            self._grid.value(index)
            for index in self._known_between(low, high)
            if self._sides[index] in (Side.LOW, Side.HIGH)
        )

    @property
    def status(self) -> SearchStatus:
        """What the search has come to."""
        if self.contradictions:
            return SearchStatus.NON_MONOTONE
        if self._regions():
            return SearchStatus.SEARCHING
        low, high = self.ends()
        if high - low > 1:
            failed = Side.FAILED in (self._sides[low + 1], self._sides[high - 1])
            return SearchStatus.FAILED if failed else SearchStatus.UNDECIDED
        bracketed = low in self._indices and high in self._indices
        return SearchStatus.CONVERGED if bracketed else SearchStatus.UNBRACKETED

    @property
    def done(self) -> bool:
        """Whether no further answer is needed."""
        return self.status is not SearchStatus.SEARCHING

    @property
    def has_certain(self) -> bool:
        """Whether no value is pending, so that the next one is needed whatever else comes."""
        return not self._pending

    @property
    def answers_left(self) -> float:
        """How many more answers are needed if each halves the bracket; 0 once done."""
        low, high = self.ends()
        return 0.0 if self.done else max(1.0, math.log2(high - low))

    @property
    def ends_of_changes(self) -> frozenset[float]:
        """The ends of the bracket that are known."""
        return frozenset(end for end in self.bracket if end is not None)

    @property
    def changes(self) -> tuple[tuple[float, float], ...]:
        """The bracket, if both of its ends are known."""
        low, high = self.bracket
        return () if low is None or high is None else ((low, high),)

    @property
    def incidental_changes(self) -> tuple[tuple[float, float], ...]:
        """None: every answer is one that this search rests on."""
        return ()

    def _prior_of(self, guess: tuple[float, float]) -> _Prior:
        first, last = self._guessed(guess)
        return _CauchyPrior(center=(first + last) / 2, half_width=max((last - first) / 2, 1))

    def ends(self) -> tuple[int, int]:
        """Return the indices of the bracket's ends, one beyond the limits where an end is unknown.

        Returns
        -------
        (int, int)
        """
        lows = [index for index, side in self._sides.items() if side is Side.LOW]
        highs = [index for index, side in self._sides.items() if side is Side.HIGH]
        below, above = self._indices[0] - 1, self._indices[-1] + 1
        smallest_high, largest_low = min(highs, default=above), max(lows, default=below)
        return (
            max((index for index in lows if index < smallest_high), default=below),
            min((index for index in highs if index > largest_low), default=above),
        )

    def _known_between(self, low: int, high: int) -> list[int]:
        return sorted(index for index in self._sides if low < index < high)

    def _regions(self) -> list[tuple[int, int]]:
        """Return the open intervals of values that are needed: neither known nor implied by what is known.

        At most two, one at each end of the bracket; the same one twice if there is nothing between.
        """
        if self.contradictions:
            return []
        low, high = self.ends()
        unanswered = self._known_between(low, high)
        gaps = [gap for gap in pairwise([low, *unanswered, high]) if gap[1] - gap[0] > 1]
        if not gaps:
            return []
        regions = []
        first, next_unanswered = gaps[0]
        if first == low:
            regions.append((low, next_unanswered))
        elif first - low < ZONE_EDGE:
            regions.append((first, min(next_unanswered, low + ZONE_EDGE + 1)))
        previous_unanswered, last = gaps[-1]
        if last == high:
            regions.append((previous_unanswered, high))
        elif high - last < ZONE_EDGE:
            regions.append((max(previous_unanswered, high - ZONE_EDGE - 1), last))
        return regions

    def _between_pending(self, low: int, high: int) -> list[tuple[int, int]]:
        cuts = sorted(index for index in self._pending if low < index < high)
        return [gap for gap in pairwise([low, *cuts, high]) if gap[1] - gap[0] > 1]
