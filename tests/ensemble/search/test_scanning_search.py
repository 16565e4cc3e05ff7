"""What a scan comes to depends on the sides of values alone, and no window wider than it says is missed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ensemble.config.geometric_grid import GeometricGrid
from ensemble.search.critical_value import SearchStatus, Side
from ensemble.search.scanning_search import ScanningSearch
from tests.ensemble.search.test_critical_value import expected, monotone_physics, threshold_at

GRID = GeometricGrid(0.01)
LIMITS = (0.05, 5.0)
INDICES = GRID.within(*LIMITS)
DENSITY = 2

Physics = Callable[[int], Side]  # the side of the value at a grid index


@dataclass(frozen=True)
class Windows:
    """Sides that change at each of these indices, whose number is odd: to high, back to low, and so on."""

    changes: tuple[int, ...]

    def __call__(self, index: int) -> Side:
        return Side.HIGH if sum(change <= index for change in self.changes) % 2 else Side.LOW

    @property
    def narrowest(self) -> float:
        """Ratio of the ends of the narrowest window."""
        widths = [high - low for low, high in pairwise(self.changes)]
        return GRID.value(min(widths, default=10_000)) / GRID.value(0)


@st.composite
def windows(draw: st.DrawFn, narrowest: int = 1) -> Windows:
    changes = [draw(st.integers(INDICES[0] + 1, INDICES[-1]))]
    for _ in range(draw(st.integers(0, 3))):
        widths = draw(st.tuples(*[st.integers(narrowest, 3 * narrowest + 40)] * 2))
        upward = [changes[-1] + widths[0], changes[-1] + sum(widths)]
        downward = [changes[0] - sum(widths), changes[0] - widths[0]]
        if draw(st.booleans()) and upward[-1] <= INDICES[-1]:
            changes += upward
        elif downward[0] > INDICES[0]:
            changes = downward + changes
    return Windows(tuple(changes))


def finish(
    search: ScanningSearch, physics: Physics, workers: int = 1, order: Random | None = None
) -> list[float]:
    """Run a search to its end; with an order answers arrive in it and some are lost.  The values answered."""
    pending: list[float] = []
    answered: list[float] = []
    while not search.done:
        while len(pending) < workers and (value := search.ask()) is not None:
            pending.append(value)
        assert pending, "a search that is not done must have asked for something"
        value = pending.pop(0 if order is None else order.randrange(len(pending)))
        if order is not None and order.random() < 0.1:
            search.withdraw(value)
        else:
            search.tell(value, physics(GRID.index(value)))
            answered.append(value)
        for value in search.unneeded():
            search.withdraw(value)
            pending.remove(value)
    assert not pending
    assert search.ask() is None
    assert search.answers_left == 0
    return answered


def alone(physics: Physics, density: int = DENSITY) -> ScanningSearch:
    search = ScanningSearch(GRID, LIMITS, density)
    finish(search, physics)
    return search


guesses = st.none() | st.tuples(st.floats(1e-3, 100.0), st.floats(1.0, 50.0)).map(
    lambda g: (g[0], g[0] * g[1])
)
circumstances = st.fixed_dictionaries(
    {
        "guess": guesses,
        "workers": st.integers(1, 9),
        "order": st.none() | st.randoms(use_true_random=False),
        "told": st.sets(st.integers(INDICES[0], INDICES[-1]), max_size=8),
    }
)


def under(
    physics: Physics, circumstances: dict[str, Any], limits: tuple[float, float] = LIMITS
) -> ScanningSearch:
    search = ScanningSearch(GRID, limits, DENSITY, circumstances["guess"])
    for index in circumstances["told"] & set(GRID.within(*limits)):
        search.tell(GRID.value(index), physics(index))
    finish(search, physics, circumstances["workers"], circumstances["order"])
    return search


@settings(deadline=None)
@given(physics=windows(), circumstances=circumstances, margins=st.tuples(*[st.integers(1, 100)] * 2))
def test_the_bracket_depends_on_the_physics_alone_whatever_the_windows(
    physics: Windows, circumstances: dict[str, Any], margins: tuple[int, int]
) -> None:
    first, last = physics.changes[0] - margins[0], physics.changes[-1] + margins[1]
    limits = (GRID.value(max(first, INDICES[0])), GRID.value(min(last, INDICES[-1])))
    here, there = alone(physics), under(physics, circumstances, limits)
    assert there.bracket == here.bracket
    assert (there.changes, there.status) == (here.changes, here.status)
    within = [value for value in here.looked_at if limits[0] <= value <= limits[1]]
    assert list(there.looked_at) == within
    for low, high in there.changes + there.incidental_changes:
        assert physics(GRID.index(low)) is not physics(GRID.index(high))
        assert GRID.index(high) - GRID.index(low) == 1


@settings(deadline=None)
@given(physics=windows(narrowest=120), circumstances=circumstances)
def test_no_window_wider_than_it_says_is_missed(physics: Windows, circumstances: dict[str, Any]) -> None:
    search = under(physics, circumstances)
    widest = search.widest_unseen
    assert widest is not None
    assert physics.narrowest > widest, "a window of 120 steps is wider than any gap of the lattice"
    assert search.changes == tuple((GRID.value(i - 1), GRID.value(i)) for i in physics.changes)
    assert search.bracket == search.changes[-1]
    many = len(physics.changes) > 1
    assert search.status is (SearchStatus.NON_MONOTONE if many else SearchStatus.CONVERGED)


@settings(deadline=None)
@given(physics=windows(), density=st.integers(1, 20))
def test_what_is_said_of_windows_that_may_be_missed_is_true(physics: Windows, density: int) -> None:
    search = alone(physics, density)
    known = sorted(
        {*search.looked_at, *LIMITS_ON_GRID, *(end for change in search.changes for end in change)}
    )
    assert search.widest_unseen == pytest.approx(max(high / low for low, high in pairwise(known)), rel=1e-12)
    for value in search.looked_at:
        below = sum(high <= value for _, high in search.changes)
        assert physics(GRID.index(value)) is (Side.HIGH if below % 2 else Side.LOW)


LIMITS_ON_GRID = (GRID.value(INDICES[0]), GRID.value(INDICES[-1]))


@settings(deadline=None)
@given(physics=monotone_physics(), circumstances=circumstances)
def test_where_outcomes_are_monotone_it_comes_to_the_same_as_a_search_that_does_not_scan(
    physics: Physics, circumstances: dict[str, Any]
) -> None:
    search = under(physics, circumstances)
    assert (search.status, search.bracket) == expected(physics)


@given(first_high=st.integers(INDICES[0] + 1, INDICES[-1]))
def test_the_scan_is_dense_near_the_answer_and_spread_over_the_limits(first_high: int) -> None:
    search = alone(threshold_at(first_high))
    places = [GRID.index(value) for value in search.looked_at]
    assert len(places) <= 15
    spacing = GRID.points_per_decade / DENSITY
    low, high = first_high - 1, first_high
    outward = ([low, *(i for i in reversed(places) if i < low)], [high, *(i for i in places if i > high)])
    for path, end in zip(outward, (INDICES[0], INDICES[-1]), strict=True):
        for near, far in pairwise([*path, end]):
            allowed = min(max(2 * abs(near - path[0]), spacing / 5), spacing)
            assert abs(far - near) <= 1.5 * allowed + 1


def test_a_window_that_another_run_has_seen_is_bracketed_and_moves_no_answer() -> None:
    physics = Windows((-200, -197, -100))
    plain = alone(physics)
    assert plain.status is SearchStatus.CONVERGED, "a window of three values lies in a gap"
    search = ScanningSearch(GRID, LIMITS, DENSITY)
    search.tell(GRID.value(-198), Side.HIGH)
    finish(search, physics)
    for what in ("status", "bracket", "changes", "looked_at", "widest_unseen"):
        assert getattr(search, what) == getattr(plain, what), what
    changes = tuple((GRID.value(i - 1), GRID.value(i)) for i in physics.changes)
    assert (search.incidental_changes, search.changes) == (changes[:2], changes[2:])


def test_a_late_answer_that_contradicts_opens_the_search_again() -> None:
    search = alone(threshold_at(-100))
    search.tell(GRID.value(-198), Side.HIGH)
    assert search.status is SearchStatus.SEARCHING
    assert search.changes == ()
    finish(search, Windows((-200, -197, -100)))
    assert search.status is SearchStatus.CONVERGED
    assert len(search.incidental_changes) == 2


def test_values_of_the_lattice_come_first_those_near_the_guess_before_others() -> None:
    search = ScanningSearch(GRID, LIMITS, DENSITY, guess=(0.35, 0.37))
    asked = [search.ask() for _ in range(4)]
    assert asked == pytest.approx([10**-0.5, 1.0, 0.1, 10**0.5], rel=1e-12)
    assert search.ask() is None, "nothing else is needed whatever the answers are"
    for value in asked[:2]:
        assert value is not None
        search.tell(value, Side.LOW if value < 0.36 else Side.HIGH)
    assert search.has_certain
    middle = search.ask()
    assert middle == pytest.approx(10**-0.25, rel=1e-12)
    assert not search.has_certain
    assert search.ask() == pytest.approx(10**-0.375, rel=0.01), "below the middle, as the guess says"


def test_values_of_the_scan_are_shared_by_grids_of_other_tolerances() -> None:
    lattices = []
    for tolerance in (0.01, 0.05):
        search = ScanningSearch(GeometricGrid(tolerance), LIMITS, DENSITY)
        lattices.append([search.ask() for _ in range(4)])
    assert lattices[0] == lattices[1]


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 0.5])
def test_any_tolerance_is_searched_at_once(tolerance: float) -> None:
    grid = GeometricGrid(tolerance)
    search = ScanningSearch(grid, LIMITS, 100)
    while (value := search.ask()) is not None:
        search.tell(value, Side.LOW if value < 0.3635 else Side.HIGH)
    low, high = search.bracket
    assert low is not None
    assert high is not None
    assert low < 0.3635 <= high < low * (1 + tolerance)


def test_refusals_name_what_is_wrong() -> None:
    search = ScanningSearch(GRID, LIMITS, DENSITY)
    with pytest.raises(ValueError, match="not on the grid"):
        search.tell(0.3333, Side.LOW)
    with pytest.raises(ValueError, match="outside the limits"):
        search.tell(10.0, Side.LOW)
    with pytest.raises(ValueError, match="not pending"):
        search.withdraw(1.0)
    search.tell(1.0, Side.LOW)
    with pytest.raises(ValueError, match="cannot be high: it is known to be low"):
        search.tell(1.0, Side.HIGH)
    with pytest.raises(ValueError, match="no two values"):
        ScanningSearch(GRID, (1.001, 1.002), DENSITY)
    with pytest.raises(ValueError, match="guess"):
        ScanningSearch(GRID, LIMITS, DENSITY, guess=(0.0, 1.0))
