"""The brackets of a boundary that are known, and where they lead to expect the others."""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from operator import mul

from ensemble.config.study import Study

Place = tuple[float, ...]  # the value of each swept parameter
Bracket = tuple[float, float]

# A curve through known points is off by what their brackets leave open, and by this share of how far it lies
# from the simpler curve with a point less.
CURVATURE_MARGIN = 0.05

_POINTS = 3  # that a curve goes through, at most: a parabola


class KnownBrackets:
    """Brackets by place, of which those near a place are found in a time that grows with the logarithm."""

    def __init__(self) -> None:
        self._brackets: dict[Place, Bracket] = {}
        # Ascending, the values of one parameter at which a bracket is known, by the values of the others.
        self._lines: dict[tuple[int, Place], list[float]] = {}

    def note(self, at: Place, bracket: Bracket | None) -> None:
        """Take the bracket at a place, or take note that there is none any more.

        Parameters
        ----------
        at : tuple of float
        bracket : (float, float) or None
        """
        if (at in self._brackets) != (bracket is not None):
            for axis, value in enumerate(at):
                line = self._lines.setdefault((axis, _others(at, axis)), [])
                if bracket is None:
                    line.remove(value)
                else:
                    insort(line, value)
        if bracket is None:
            self._brackets.pop(at, None)
        else:
            self._brackets[at] = bracket

    def near(self, at: Place) -> dict[Place, Bracket]:
        """Return the brackets from which that at a place is expected.

        Parameters
        ----------
        at : tuple of float

        Returns
        -------
        dict of (float, float) by place
            Those of the nearest places along each parameter, and of the places across from them.
        """
        along = [list(self._along(at, axis)) for axis in range(len(at))]
        places = {place for line in along for place in line}
        for first, second in combinations(range(len(at)), 2):
            places |= {
                _with(one, second, other[second]) for one in along[first] for other in along[second]
            } & self._brackets.keys()
        return {place: self._brackets[place] for place in places} or dict(self._brackets)

    def _along(self, at: Place, axis: int) -> Iterator[Place]:
        line = self._lines.get((axis, _others(at, axis)), [])
        position = bisect_left(line, at[axis])
        for value in line[max(0, position - _POINTS) : position + _POINTS]:
            yield _with(at, axis, value)


def expected_bracket(study: Study, at: Place, known: Mapping[Place, Bracket]) -> Bracket | None:
    """Return where the critical value is expected, from the points of the boundary that are known.

    Along each parameter with two or more neighbors it is expected near the straight line through two of them,
    one on either side if possible, and near the parabola through a third one.  Between two parameters it is
    expected to change with one as it does at the nearest known value of the other.  The narrowest of these
    expectations counts.  If there is none, the boundary is expected to lie between constant and proportional
    to each parameter.

    Parameters
    ----------
    study : Study
    at : tuple of float
        Where the boundary is searched for.
    known : mapping of (float, float) by place
        Points to which searches have converged.

    Returns
    -------
    (float, float) or None
        Two values within the limits.  While fewer than two points are known, the study's own guesses stand
        in for points; None if there are none either.
    """
    if len(known) < 2:
        known = {guess.at: guess.bracket for guess in study.search.guesses} | dict(known)
    if not known or at in known:
        return known.get(at)
    expected = [*_on_curves(study, at, known), *_across(study, at, known)]
    if not expected:
        expected = [_spread(at, place, bracket) for place, bracket in known.items()]
    low, high = min(expected, key=lambda ends: ends[1] - ends[0])
    return _within_limits(study, low, high)


def _on_curves(study: Study, at: Place, known: Mapping[Place, Bracket]) -> Iterator[Bracket]:
    """Yield what the straight line and the parabola through neighbors along one parameter lead to expect."""
    for axis, value in enumerate(at):
        line = {
            place[axis]: bracket
            for place, bracket in known.items()
            if _others(place, axis) == _others(at, axis)
        }
        if len(line) < 2:
            continue
        nearest, *others = sorted(line, key=lambda each: abs(each - value))
        on_other_side = (each for each in others if (each - value) * (nearest - value) < 0)
        other = next(on_other_side, others[0])
        places = [nearest, other, *(each for each in others if each != other)]
        centers = [_center(line[place]) for place in places[:_POINTS]]
        uncertainties = [_uncertainty(study, line[place]) for place in places[:_POINTS]]
        simpler = centers[0]
        for count in range(2, len(centers) + 1):
            weights = _lagrange_weights(value, places[:count])
            estimate = sum(map(mul, weights, centers))
            middle = _within_limits(study, estimate, math.inf)[0]
            margin = math.hypot(*map(mul, weights, uncertainties)) * middle
            margin += CURVATURE_MARGIN * abs(estimate - simpler)
            yield middle - margin, middle + margin
            simpler = estimate


def _lagrange_weights(at: float, nodes: Sequence[float]) -> list[float]:
    """Return the weights of the values at nodes in the value of the polynomial through them."""
    return [math.prod((at - other) / (node - other) for other in nodes if other != node) for node in nodes]


def _across(study: Study, at: Place, known: Mapping[Place, Bracket]) -> Iterator[Bracket]:
    """Yield what three corners of a rectangle, whose fourth is the place, lead to expect.

    A sum and a product of functions of the two parameters differ by as much as is added as a margin.
    """
    for corner, bracket in known.items():
        different = [axis for axis, value in enumerate(at) if corner[axis] != value]
        if len(different) != 2:
            continue
        one, other = (known.get(_with(corner, axis, at[axis])) for axis in different)
        if one is None or other is None:
            continue
        first, second, opposite = map(_center, (one, other, bracket))
        middle = first * second / opposite
        uncertainty = math.hypot(*(_uncertainty(study, each) for each in (one, other, bracket)))
        margin = uncertainty * middle + abs(middle - (first + second - opposite))
        yield middle - margin, middle + margin


def _spread(at: Place, place: Place, bracket: Bracket) -> Bracket:
    center, spread = _center(bracket), 1.0
    for value, there in zip(at, place, strict=True):
        ratio = value / there if there else 0.0
        # Proportionality means nothing across zero.
        spread *= max(ratio, 1 / ratio) if ratio > 0 else 1.0 if value == there else 2.0
    return center / spread, center * spread


def _center(bracket: Bracket) -> float:
    return math.sqrt(bracket[0] * bracket[1])


def _uncertainty(study: Study, bracket: Bracket) -> float:
    """Return the relative standard deviation of a critical value that may lie anywhere in a bracket."""
    low, high = bracket
    return max(study.search.tolerance / 2, (high - low) / (high + low)) / math.sqrt(3)


def _others(place: Place, axis: int) -> Place:
    return place[:axis] + place[axis + 1 :]


def _with(place: Place, axis: int, value: float) -> Place:
    return (*place[:axis], value, *place[axis + 1 :])


def _within_limits(study: Study, low: float, high: float) -> Bracket:
    first, last = study.search.limits
    return min(max(low, first), last), min(max(high, first), last)
