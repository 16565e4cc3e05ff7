"""Search for all changes of the outcome that a scan of the limits can see.  Pure: no MPI, no files, no clock.

A bisection finds *a* change of side.  This search looks at values all over the limits as well, so that it can
say how wide a window of another outcome must be to have been missed.  It looks at

1. the values of a lattice that is the same for all limits: `density` of them in a decade, from 1.0;
2. the values of plain bisections, one between any two neighbors among these that lie on different sides;
3. rungs on either side of the answer, at distances that grow threefold, where there is a gap.

Where a rung shows another change, the second step goes on there.  The answer is the highest change from low
to high: above it everything that was looked at is high.

Which values these are follows from the sides of such values alone.  So the answer is the same to the last bit
whatever the guess, the limits (if they contain every change), the number of workers and the order of answers,
and whatever the outcomes are.  Other answers, of runs made ahead or for other studies, have no influence on
it.  But none is passed over: where one contradicts, the search brackets the changes beside it too, and gives
them as `incidental_changes`.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, pairwise

from ensemble.config.geometric_grid import GeometricGrid
from ensemble.search.critical_value import CriticalValueSearch, GridSearch, SearchStatus, Side

_OPPOSITE = {Side.LOW: Side.HIGH, Side.HIGH: Side.LOW}

# A gap beside the answer is filled if it is _SLACK times wider than allowed.  Allowed are _GROWTH times its
# distance from the answer, but at least a share 1/_FIRST_RUNG of the lattice's spacing and at most all of it.
_FIRST_RUNG = 5
_GROWTH = 2
_SLACK = 1.5


class _Bisection:
    """Plain bisection between two values on different sides, which takes one answer at a time.

    Parameters
    ----------
    grid : GeometricGrid
        That of the search.
    low, high : int
        Indices of the two values.
    rising : bool
        Whether the lower value lies on the low side.
    without_answer : dict of int to Side
        Values in between that are known to give no answer.
    """

    def __init__(
        self, grid: GeometricGrid, low: int, high: int, rising: bool, without_answer: dict[int, Side]
    ) -> None:
        self.rising = rising
        self.passed: tuple[int, ...] = ()
        self._grid = grid
        self._search = CriticalValueSearch(grid, (grid.value(low), grid.value(high)))
        for index, side in ({low: Side.LOW, high: Side.HIGH} | without_answer).items():
            self._search.tell(grid.value(index), side)
        self.next = self._ask()

    def tell(self, side: Side) -> None:
        """Take the answer for the next value."""
        assert self.next is not None
        self._search.tell(self._grid.value(self.next), side if self.rising else _OPPOSITE.get(side, side))
        self.passed += (self.next,)
        self.next = self._ask()

    def supposing(self, side: Side) -> _Bisection:
        """Return the bisection as it would be with this answer for the next value."""
        other = copy.copy(self)
        other._search = self._search.copy()
        other.tell(side)
        return other

    @property
    def between(self) -> tuple[int, int]:
        """Indices of the values between which the side changes, as far as it is known."""
        return self._search.ends()

    @property
    def status(self) -> SearchStatus:
        return self._search.status

    def _ask(self) -> int | None:
        value = self._search.ask()
        return None if value is None else self._grid.index(value)


class ScanningSearch(GridSearch):
    """The search for all changes of side on a grid, within limits, that a scan can see.

    Parameters
    ----------
    grid : GeometricGrid
        The values that may be tried.
    limits : (float, float)
        Least and greatest value that may be tried, 0 < low < high.  What lies below is taken to be low, what
        lies above to be high.
    density : int
        How many values of the lattice lie in a decade, at least 1; at most all values of the grid.
    guess : (float, float), optional
        Where the critical value is expected.  It decides only what is tried first; it may be wrong.

    Raises
    ------
    ValueError
        If fewer than two grid values lie within the limits, or the guess is not 0 < low <= high.
    """

    def __init__(
        self,
        grid: GeometricGrid,
        limits: tuple[float, float],
        density: int,
        guess: tuple[float, float] | None = None,
    ) -> None:
        super().__init__(grid, limits)
        self._density = min(density, grid.points_per_decade)
        self._center = (self._indices[0] + self._indices[-1]) / 2
        if guess is not None:
            self.replace_guess(guess)
        self._begin()

    def _begin(self) -> None:
        """Begin with the lattice, and go on as far as the known answers allow."""
        # What the answer rests on, also beyond the limits; the awaited values have no answer yet.
        self._looked_at = set(self._lattice())
        self._awaited = {index for index in self._looked_at if index in self._indices}
        self._bisections: dict[tuple[int, int], _Bisection] = {}
        self._bracketed: dict[tuple[int, int], SearchStatus] = {}
        self._answer: tuple[int, int] | None = None
        self._advance()

    def ask(self) -> float | None:
        """Return the most useful value to try now and mark it as pending.

        Returns
        -------
        float or None
            A value whose answer is needed in any case.  If all of those are pending, one that is needed if
            their answers come out in one way.  None if there is no such value either.
        """
        for index in chain(self._certain(), self._ahead()):
            if index not in self._pending:
                return self._try(index)
        return None

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
        super().tell(value, side)
        self._advance()

    def revise(self, sides: Mapping[float, Side]) -> None:
        """Take better answers for values that are known, and come to what follows from them.

        Parameters
        ----------
        sides : mapping from float to Side
            By value.
        """
        super().revise(sides)
        self._begin()

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
        self._center = sum(self._guessed(guess)) / 2

    def unneeded(self) -> frozenset[float]:
        """Return the pending values whose answers are no longer needed."""
        intervals = [bisection.between for bisection in self._bisections.values()]
        return frozenset(
            self._grid.value(index)
            for index in self._pending - self._awaited
            if not any(low < index < high for low, high in intervals)
        )

    @property
    def has_certain(self) -> bool:
        """Whether there is a value that is not pending and whose answer is needed in any case."""
        return any(index not in self._pending for index in self._certain())

    @property
    def answers_left(self) -> float:
        """How many more answers are needed if no other change comes to light; 0 once done."""
        intervals = [bisection.between for bisection in self._bisections.values()]
        if not intervals and not self._bracketed:
            intervals.append((0, self._spacing))
        return len(self._awaited) + sum(max(1.0, math.log2(high - low)) for low, high in intervals)

    @property
    def done(self) -> bool:
        """Whether no further answer is needed."""
        return self._answer is not None and not self._bisections

    @property
    def status(self) -> SearchStatus:
        """What the search has come to."""
        if self._answer is None or self._bisections:
            return SearchStatus.SEARCHING
        if len(self._differing(self._looked_at)) > 1:
            return SearchStatus.NON_MONOTONE
        low, high = self._answer
        if high - low == 1 and not (low in self._indices and high in self._indices):
            return SearchStatus.UNBRACKETED
        return self._bracketed[self._answer]

    @property
    def bracket(self) -> tuple[float | None, float | None]:
        """The answer, as far as it is known; None for an end that is outside the limits."""
        return self._values(*(self._answer or self._highest_rise(self._looked_at | self._sides.keys())))

    @property
    def changes(self) -> tuple[tuple[float, float], ...]:
        """The values within the limits between which the side changes, ascending; empty until done."""
        return self._within_limits(self._differing(self._looked_at))

    @property
    def incidental_changes(self) -> tuple[tuple[float, float], ...]:
        """Further changes, that answers beside those of this search show, ascending; empty until done."""
        own = set(self._differing(self._looked_at))
        seen = self._differing(self._looked_at | self._sides.keys())
        return self._within_limits(change for change in seen if change not in own)

    @property
    def ends_of_changes(self) -> frozenset[float]:
        """The ends, within the limits, of all changes that the answer rests on."""
        ends = {end for change in self._differing(self._looked_at) for end in change}
        return frozenset(self._grid.value(index) for index in ends if index in self._indices)

    @property
    def looked_at(self) -> tuple[float, ...]:
        """The values that the answer rests on, without the ends of brackets, ascending; empty until done."""
        ends = {end for change in self._differing(self._looked_at) for end in change}
        values = self._decided(self._looked_at - ends) if self.done else []
        return tuple(self._grid.value(index) for index in values if index in self._indices)

    @property
    def widest_unseen(self) -> float | None:
        """The largest ratio of two neighbors among the values that the answer rests on, and the limits.

        A window between changes back and forth is seen if the ratio of its ends is larger.

        Returns
        -------
        float or None
            None until done.
        """
        if not self.done:
            return None
        first, last = self._indices[0], self._indices[-1]
        inside = (index for index in self._decided(self._looked_at) if first < index < last)
        low, high = max(pairwise([first, *inside, last]), key=lambda pair: pair[1] - pair[0])
        return self._grid.value(high) / self._grid.value(low)

    @property
    def _spacing(self) -> int:
        """Of the lattice, in steps of the grid, rounded up."""
        return -(-self._grid.points_per_decade // self._density)

    def _lattice(self) -> list[int]:
        """Return the lattice within the limits, and the nearest of its values beyond them on either side."""
        per_decade, density = self._grid.points_per_decade, self._density
        first, last = self._indices[0], self._indices[-1]
        numbers = range(first * density // per_decade - 1, last * density // per_decade + 3)
        lattice = [(2 * number * per_decade + density) // (2 * density) for number in numbers]
        below = max(index for index in lattice if index < first)
        above = min(index for index in lattice if index > last)
        return [index for index in lattice if below <= index <= above]

    def _side(self, index: int) -> Side | None:
        """Return the side of a value; None if it is not known."""
        if index < self._indices[0]:
            return Side.LOW
        return Side.HIGH if index > self._indices[-1] else self._sides.get(index)

    def _decided(self, indices: Iterable[int]) -> list[int]:
        return sorted(index for index in indices if self._side(index) in _OPPOSITE)

    def _differing(self, indices: Iterable[int]) -> list[tuple[int, int]]:
        """Return the neighbors among indices that lie on different sides."""
        return [
            (low, high)
            for low, high in pairwise(self._decided(indices))
            if self._side(low) is not self._side(high)
        ]

    def _within_limits(self, changes: Iterable[tuple[int, int]]) -> tuple[tuple[float, float], ...]:
        """Return the values of changes that lie within the limits; none until done."""
        return tuple(
            (self._grid.value(low), self._grid.value(high))
            for low, high in (changes if self.done else ())
            if low in self._indices and high in self._indices
        )

    def _highest_rise(self, indices: Iterable[int]) -> tuple[int, int]:
        # There is one: the least index lies below the limits, hence low, and the greatest above, hence high.
        return max(change for change in self._differing(indices) if self._side(change[0]) is Side.LOW)

    def _certain(self) -> Iterator[int]:
        """Yield the values needed in any case, those of bisections first, then the nearest to the guess."""
        for bisection in self._bisections.values():
            if bisection.next is not None:
                yield bisection.next
        yield from sorted(self._awaited, key=lambda index: (abs(index - self._center), index))

    def _ahead(self) -> Iterator[int]:
        """Yield the values that bisections may need later: the nearer ones first, then the expected ones."""
        branches = list(self._bisections.values())
        while branches:
            later = []
            for branch in branches:
                if branch.next is None:
                    continue
                yield branch.next
                expected = Side.LOW if (branch.next < self._center) is branch.rising else Side.HIGH
                later += [branch.supposing(side) for side in (expected, _OPPOSITE[expected])]
            for branch in later:
                self._carry_on(branch)
            branches = later

    def _carry_on(self, bisection: _Bisection) -> None:
        """Tell a bisection what is known already."""
        while bisection.next is not None and (side := self._side(bisection.next)) is not None:
            bisection.tell(side)

    def _advance(self) -> None:
        """Go on as far as the known answers allow."""
        while self._answer is None:
            self._awaited = {index for index in self._awaited if self._side(index) is None}
            self._bisect(self._looked_at)
            if self._awaited or self._bisections:
                return
            rungs = set(self._missing_rungs()) - self._looked_at
            self._looked_at |= rungs
            self._awaited |= rungs
            if not rungs:
                self._answer = self._highest_rise(self._looked_at)
        self._bisect(self._looked_at | self._sides.keys())

    def _bisect(self, indices: set[int]) -> None:
        """Bisect between neighbors on different sides, unless an answer between them is still awaited."""
        for low, high in self._differing(indices):
            between = [index for index in indices if low < index < high]
            known = (low, high) in self._bracketed or (low, high) in self._bisections
            if known or not self._sides.keys() >= set(between):
                continue
            rising, silent = self._side(low) is Side.LOW, {index: self._sides[index] for index in between}
            self._bisections[low, high] = _Bisection(self._grid, low, high, rising, silent)
        for place, bisection in tuple(self._bisections.items()):
            self._carry_on(bisection)
            if bisection.next is None:
                del self._bisections[place]
                self._bracketed[bisection.between] = bisection.status
                if self._answer is None:
                    self._looked_at.update(bisection.passed)

    def _missing_rungs(self) -> Iterator[int]:
        """Yield, on either side of the answer, where the first gap that is too wide is cut."""
        low, high = self._highest_rise(self._looked_at)
        for direction, nearest in ((-1, low), (1, high)):
            outward = sorted(index for index in self._looked_at if direction * (index - nearest) >= 0)
            for near, far in pairwise(outward[::direction]):
                distance = abs(near - nearest)
                step = min(max(_GROWTH * distance, self._spacing // _FIRST_RUNG, 1), self._spacing)
                if abs(far - near) > _SLACK * step:
                    yield near + direction * step
                    break
