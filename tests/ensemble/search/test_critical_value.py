"""The final bracket depends on the physics alone, and is found in as few runs as bisection allows."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ensemble.config.geometric_grid import GeometricGrid
from ensemble.search.critical_value import ZONE_EDGE, CriticalValueSearch, SearchStatus, Side

GRID = GeometricGrid(0.01)
LIMITS = (0.05, 5.0)
INDICES = GRID.within(*LIMITS)
SILENT = (Side.UNDECIDED, Side.FAILED)

Physics = Callable[[int], Side]  # the side of the value at a grid index


def threshold_at(first_high: int) -> Physics:
    return lambda index: Side.LOW if index < first_high else Side.HIGH


@dataclass
class Trace:
    """How a search went: the values asked and the rounds, when all workers answer at once."""

    asked: list[float]
    rounds: int


def finish(
    search: CriticalValueSearch,
    physics: Physics,
    *,
    workers: int = 1,
    order: Random | None = None,
    cancel: bool = False,
) -> Trace:
    """Run a search to its end.  With an order, answers arrive one at a time in it, and some are lost."""
    pending: list[float] = []
    run_study = Trace([], 0)
    while not search.done:
        while len(pending) < workers and (value := search.ask()) is not None:
            pending.append(value)
            run_study.asked.append(value)
        assert pending, "a search that is not done must have asked for something"
        run_study.rounds += 1
        answers = list(pending) if order is None else [order.choice(pending)]
        for value in answers:
            pending.remove(value)
            if order is not None and order.random() < 0.1:
                search.withdraw(value)
                run_study.asked.remove(value)
            else:
                search.tell(value, physics(GRID.index(value)))
        if cancel:
            for value in search.unneeded():
                search.withdraw(value)
                pending.remove(value)
    assert search.ask() is None
    for value in pending:  # stragglers must not change what the search has come to
        before = search.status, search.bracket
        search.tell(value, physics(GRID.index(value)))
        assert (search.status, search.bracket) == before
    return run_study


def expected(
    physics: Physics, indices: range = INDICES
) -> tuple[SearchStatus, tuple[float | None, float | None]]:
    """What the physics says, by looking at every value."""
    low = max((index for index in indices if physics(index) is Side.LOW), default=indices[0] - 1)
    high = min((index for index in indices if physics(index) is Side.HIGH), default=indices[-1] + 1)
    bracket = (
        GRID.value(low) if low in indices else None,
        GRID.value(high) if high in indices else None,
    )
    if high - low > 1:
        failed = Side.FAILED in (physics(low + 1), physics(high - 1))
        return (SearchStatus.FAILED if failed else SearchStatus.UNDECIDED), bracket
    return (SearchStatus.UNBRACKETED if None in bracket else SearchStatus.CONVERGED), bracket


@st.composite
def monotone_physics(draw: st.DrawFn) -> Physics:
    """A threshold anywhere (also outside the limits), one zone without answers there, failures elsewhere."""
    first_high = draw(st.integers(INDICES[0], INDICES[-1] + 1))
    zone = range(first_high - draw(st.integers(0, 40)), first_high + draw(st.integers(0, 40)))
    zone_sides = draw(st.lists(st.sampled_from(SILENT), min_size=1, max_size=5))
    # In rows of at most two and apart from the zone, so that at most one row of such values is long.
    anywhere = st.integers(INDICES[0], INDICES[-1]).filter(lambda index: index % 4 < 2)
    isolated = {
        index for index in draw(st.sets(anywhere, max_size=30)) if not zone.start - 4 < index < zone.stop + 4
    }

    def side(index: int) -> Side:
        if index in zone:
            return zone_sides[index % len(zone_sides)]
        return Side.FAILED if index in isolated else threshold_at(first_high)(index)

    return side


guesses = st.none() | st.tuples(st.floats(1e-3, 100.0), st.floats(1.0, 50.0)).map(
    lambda g: (g[0], g[0] * g[1])
)


@given(
    physics=monotone_physics(),
    workers=st.integers(1, 9),
    order=st.none() | st.randoms(use_true_random=False),
    cancel=st.booleans(),
    told=st.sets(st.integers(INDICES[0], INDICES[-1]), max_size=12),
    guess=guesses,
)
def test_bracket_depends_on_the_physics_alone(
    physics: Physics,
    workers: int,
    order: Random | None,
    cancel: bool,
    told: set[int],
    guess: tuple[float, float] | None,
) -> None:
    search = CriticalValueSearch(GRID, LIMITS, guess)
    for index in told:
        search.tell(GRID.value(index), physics(index))
    run_study = finish(search, physics, workers=workers, order=order, cancel=cancel)
    assert (search.status, search.bracket) == expected(physics)
    assert search.contradictions == ()
    if not cancel:
        assert len(set(run_study.asked)) == len(run_study.asked)
    assert not {GRID.index(value) for value in run_study.asked} & told


@given(first_high=st.integers(INDICES[0] + 1, INDICES[-1]))
def test_alone_a_search_is_a_bisection(first_high: int) -> None:
    search = CriticalValueSearch(GRID, LIMITS)
    run_study = finish(search, threshold_at(first_high))
    low, high = search.bracket
    assert low is not None
    assert high is not None
    assert (high - low) / low < 0.01
    assert len(run_study.asked) <= math.ceil(math.log2(len(INDICES) + 1))


@pytest.mark.parametrize("workers", [1, 2, 3, 4, 7, 15])
def test_rounds_fall_with_the_logarithm_to_base_workers_plus_one(workers: int) -> None:
    thresholds = range(INDICES[0], INDICES[-1] + 2)
    rounds = [
        finish(CriticalValueSearch(GRID, LIMITS), threshold_at(first_high), workers=workers).rounds
        for first_high in thresholds
    ]
    ideal = math.log(len(thresholds), workers + 1)
    assert ideal <= sum(rounds) / len(rounds) + 1e-9
    assert sum(rounds) / len(rounds) <= 1.1 * ideal + 0.5


def test_a_good_guess_saves_most_of_the_bisection() -> None:
    critical = 0.3630
    first_high = GRID.within(critical, 1.0)[0]
    run_study = finish(CriticalValueSearch(GRID, LIMITS, guess=(0.35, 0.37)), threshold_at(first_high))
    assert len(run_study.asked) <= 5


@given(
    first_high=st.integers(INDICES[0] + 1, INDICES[-1]),
    center=st.integers(INDICES[0], INDICES[-1]),
    half_width=st.integers(1, 50),
)
def test_a_wrong_guess_costs_twice_the_logarithm_of_how_wrong_it_is(
    first_high: int, center: int, half_width: int
) -> None:
    guess = (GRID.value(center - half_width), GRID.value(center + half_width))
    run_study = finish(CriticalValueSearch(GRID, LIMITS, guess), threshold_at(first_high))
    half_widths_off = abs(first_high - center) / half_width
    assert len(run_study.asked) <= math.log2(half_width) + 2 * math.log2(1 + half_widths_off) + 3


def test_a_wide_zone_without_answers_is_closed_in_by_bisection() -> None:
    zone = range(-150, 50)
    search = CriticalValueSearch(GRID, LIMITS)
    run_study = finish(search, lambda index: Side.UNDECIDED if index in zone else threshold_at(0)(index))
    assert search.status is SearchStatus.UNDECIDED
    assert search.bracket == (GRID.value(-151), GRID.value(50))
    assert len(run_study.asked) <= 2 * math.log2(len(INDICES)) + 2 * ZONE_EDGE


def test_a_few_failures_on_both_sides_do_not_hide_the_critical_value() -> None:
    search = CriticalValueSearch(GRID, LIMITS)
    search.tell(GRID.value(-4), Side.LOW)
    for index in (-3, -2, 1, 2):
        search.tell(GRID.value(index), Side.FAILED)
    search.tell(GRID.value(3), Side.HIGH)
    finish(search, threshold_at(0))
    assert search.status is SearchStatus.CONVERGED
    assert search.bracket == (GRID.value(-1), GRID.value(0))


def test_a_scene_that_always_fails_is_given_up_after_few_runs() -> None:
    search = CriticalValueSearch(GRID, LIMITS)
    run_study = finish(search, lambda index: Side.FAILED)
    assert search.status is SearchStatus.FAILED
    assert search.bracket == (None, None)
    assert len(run_study.asked) <= 2 * math.log2(len(INDICES)) + 2 * ZONE_EDGE


@given(
    sides=st.dictionaries(
        st.integers(INDICES[0], INDICES[-1]), st.sampled_from(Side), min_size=2, max_size=12
    ),
    order=st.randoms(use_true_random=False),
)
def test_a_low_above_a_high_is_reported_whatever_the_order(sides: dict[int, Side], order: Random) -> None:
    lows = [index for index, side in sides.items() if side is Side.LOW]
    highs = [index for index, side in sides.items() if side is Side.HIGH]
    contradictory = bool(lows and highs and max(lows) > min(highs))
    search = CriticalValueSearch(GRID, LIMITS)
    for index in order.sample(sorted(sides), len(sides)):
        search.tell(GRID.value(index), sides[index])
    assert (search.status is SearchStatus.NON_MONOTONE) == contradictory
    if contradictory:
        low, high = search.bracket
        assert search.done
        assert search.ask() is None
        assert {GRID.value(max(lows)), GRID.value(min(highs))} <= set(search.contradictions)
        assert all(
            GRID.value(index) >= (high or math.inf)
            for index in highs
            if GRID.value(index) not in search.contradictions
        )
        assert all(
            GRID.value(index) <= (low or 0.0)
            for index in lows
            if GRID.value(index) not in search.contradictions
        )


def test_contradictions_and_the_bracket_around_them() -> None:
    search = CriticalValueSearch(GRID, LIMITS)
    sides = {-100: Side.LOW, -50: Side.HIGH, 0: Side.UNDECIDED, 20: Side.LOW, 60: Side.HIGH, 90: Side.HIGH}
    for index, side in sides.items():
        search.tell(GRID.value(index), side)
    assert search.status is SearchStatus.NON_MONOTONE
    assert search.bracket == (GRID.value(-100), GRID.value(60))
    assert search.contradictions == (GRID.value(-50), GRID.value(20))


def test_an_answer_makes_the_speculation_beyond_it_unneeded() -> None:
    search = CriticalValueSearch(GRID, LIMITS)
    middle, *others = (search.ask() for _ in range(7))
    assert middle is not None
    assert search.unneeded() == frozenset()
    search.tell(middle, Side.HIGH)
    assert search.unneeded() == {value for value in others if value is not None and value > middle}


def test_a_contradiction_makes_every_pending_value_unneeded() -> None:
    search = CriticalValueSearch(GRID, LIMITS)
    pending = {search.ask() for _ in range(3)}
    search.tell(GRID.value(INDICES[0]), Side.HIGH)
    search.tell(GRID.value(INDICES[-1]), Side.LOW)
    assert search.bracket == (None, None)
    assert search.unneeded() == pending


def test_a_withdrawn_value_is_asked_again() -> None:
    search = CriticalValueSearch(GRID, LIMITS)
    first = search.ask()
    assert first is not None
    second = search.ask()
    assert second is not None
    assert second != first
    search.withdraw(second)
    search.withdraw(first)
    assert search.ask() == first


def test_everything_useful_pending_leaves_nothing_to_ask() -> None:
    search = CriticalValueSearch(GRID, (1.0, 1.1))
    asked = [search.ask() for _ in GRID.within(1.0, 1.1)]
    assert sorted(value for value in asked if value) == [GRID.value(index) for index in GRID.within(1.0, 1.1)]
    assert search.ask() is None
    assert not search.done


def test_another_guess_moves_the_next_value_and_forgets_no_answer() -> None:
    search = CriticalValueSearch(GRID, LIMITS)
    search.replace_guess((0.9, 1.1))
    value = search.ask()
    assert value is not None
    assert value == pytest.approx(1.0, rel=0.02)
    search.replace_guess((2.9, 3.1))
    assert search.ask() == pytest.approx(3.0, rel=0.02)
    search.tell(value, Side.LOW)
    search.replace_guess((0.2, 0.3))
    below = search.ask()
    assert below is not None
    assert below > value, "what lies below it is known to be low"
    search.replace_guess((1.5, 1.6))
    assert search.ask() == pytest.approx(1.55, rel=0.02)


def test_refusals_name_what_is_wrong() -> None:
    search = CriticalValueSearch(GRID, LIMITS)
    with pytest.raises(ValueError, match="not on the grid"):
        search.tell(0.3333, Side.LOW)
    with pytest.raises(ValueError, match="outside the limits"):
        search.tell(10.0, Side.LOW)
    with pytest.raises(ValueError, match="not pending"):
        search.withdraw(1.0)
    search.tell(1.0, Side.LOW)
    search.tell(1.0, Side.LOW)
    with pytest.raises(ValueError, match="cannot be high: it is known to be low"):
        search.tell(1.0, Side.HIGH)
    with pytest.raises(ValueError, match=r"limits: \[5.0, 0.05\]"):
        CriticalValueSearch(GRID, (5.0, 0.05))
    with pytest.raises(ValueError, match="no two values"):
        CriticalValueSearch(GRID, (1.001, 1.002))
    with pytest.raises(ValueError, match="guess"):
        CriticalValueSearch(GRID, LIMITS, guess=(0.0, 1.0))


@given(tolerance=st.floats(1e-4, 0.5), index=st.integers(-1000, 1000))
def test_neighbors_are_closer_than_the_tolerance_and_no_coarser_grid_would_do(
    tolerance: float, index: int
) -> None:
    grid = GeometricGrid(tolerance)
    low, high = grid.value(index), grid.value(index + 1)
    assert (high - low) / low < tolerance
    assert 10 ** (1 / (grid.points_per_decade - 1)) - 1 >= tolerance * (1 - 1e-9)
    assert grid.index(low) == index
    assert grid.nearest(low * (1 + 0.2 * tolerance)) == index


def test_the_grid_is_anchored_at_one_and_meets_the_decades_exactly() -> None:
    n = GRID.points_per_decade
    assert [GRID.value(index) for index in (-2 * n, -n, 0, n)] == [0.01, 0.1, 1.0, 10.0]


@given(low=st.floats(1e-3, 10.0), ratio=st.floats(1.0, 100.0))
def test_within_holds_exactly_the_values_in_the_interval(low: float, ratio: float) -> None:
    indices = GRID.within(low, low * ratio)
    values = [GRID.value(index) for index in range(indices.start - 1, indices.stop + 1)]
    assert values[0] < low
    assert values[-1] > low * ratio
    assert all(low <= value <= low * ratio for value in values[1:-1])


def test_bad_tolerance_is_refused() -> None:
    with pytest.raises(ValueError, match="tolerance"):
        GeometricGrid(0.0)
