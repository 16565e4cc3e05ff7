"""The searches of a study: sides of outcomes, and guesses that follow the boundary as far as it is known."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ensemble.config.documents import load_study
from ensemble.search.critical_value import SearchStatus, Side
from ensemble.search.study_search import critical_value_search, expected_bracket, side_of
from solver.analysis.run import Outcome

HAMAKER = load_study("critical-hamaker", ["search.scan=0"])
GRID = HAMAKER.search.grid


def test_sides_of_outcomes() -> None:
    assert {outcome: side_of(HAMAKER, outcome) for outcome in Outcome} == {
        Outcome.BOUND: Side.HIGH,
        Outcome.SEPARATED: Side.LOW,
        Outcome.FAILED: Side.FAILED,
        Outcome.UNDECIDED: Side.UNDECIDED,
        Outcome.END_TO_END: Side.UNDECIDED,
        Outcome.EQUILIBRIUM: Side.UNDECIDED,
        Outcome.STEADY: Side.UNDECIDED,
        Outcome.TUMBLING: Side.UNDECIDED,
        Outcome.COMPLETED: Side.UNDECIDED,
    }
    trap = load_study("critical-extension-rate")
    assert side_of(trap, Outcome.BOUND) is Side.LOW
    assert side_of(trap, Outcome.END_TO_END) is side_of(trap, Outcome.SEPARATED) is Side.HIGH


def test_a_whole_study_on_a_known_boundary_takes_few_runs() -> None:
    known: dict[float, tuple[float, float]] = {}
    runs = []
    for rate in HAMAKER.sweep.values:
        critical = 0.10 + 0.571 * rate  # the published fit
        search = critical_value_search(HAMAKER, expected_bracket(HAMAKER, rate, known))
        tried = 0
        while (value := search.ask()) is not None:
            search.tell(value, Side.LOW if value < critical else Side.HIGH)
            tried += 1
        assert search.status is SearchStatus.CONVERGED
        low, high = search.bracket
        assert low is not None
        assert high is not None
        assert low < critical <= high
        known[rate] = (low, high)
        runs.append(tried)
    bisection = math.log2(len(GRID.within(*HAMAKER.search.limits)))
    assert sum(runs) <= 0.75 * len(runs) * bisection
    assert max(runs[2:]) <= 6


def test_a_guess_without_neighbors_is_the_study_s_own() -> None:
    assert expected_bracket(HAMAKER, 0.25, {}) == (0.2, 0.3)
    low, high = expected_bracket(HAMAKER, 0.75, {}) or (0.0, 0.0)  # between those at 0.5 and 1.0
    assert 0.3 < low < 0.5 < high < 0.7


def test_a_known_point_replaces_the_guess_there() -> None:
    assert expected_bracket(HAMAKER, 0.5, {0.5: (0.36, 0.37)}) == (0.36, 0.37)
    low, high = expected_bracket(HAMAKER, 0.75, {0.5: (1.0, 1.0)}) or (0.0, 0.0)
    assert low < math.sqrt(0.6 * 0.7) / 2 + 1 / 2 < high


def test_a_guess_from_one_neighbor_covers_a_constant_and_a_proportional_boundary() -> None:
    unguided = load_study("critical-hamaker", ["search.guesses=[]"])
    assert expected_bracket(unguided, 0.5, {}) is None
    low, high = expected_bracket(unguided, 0.5, {0.25: (0.24, 0.24)}) or (0.0, 0.0)
    assert low == pytest.approx(0.12)
    assert high == pytest.approx(0.48)


@given(
    slope=st.floats(-0.3, 3.0),
    offset=st.floats(0.8, 2.0),
    at=st.floats(0.3, 1.45),
    known=st.sets(st.sampled_from([0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6]), min_size=2),
)
def test_a_guess_from_neighbors_holds_a_linear_boundary(
    slope: float, offset: float, at: float, known: set[float]
) -> None:
    def boundary(rate: float) -> float:
        return offset + slope * rate

    brackets = {rate: (boundary(rate), boundary(rate)) for rate in known}
    low, high = expected_bracket(HAMAKER, at, brackets) or (0.0, 0.0)
    limit = HAMAKER.search.limits[1]
    assert low <= min(boundary(at), limit) <= high
    assert high < 2 * low
    assert critical_value_search(HAMAKER, (low, high)).ask() is not None


def test_neighbors_on_both_sides_are_preferred_to_nearer_ones_on_one() -> None:
    known = {0.8: (1.0, 1.0), 0.9: (2.0, 2.0), 1.5: (2.0, 2.0)}
    low, high = expected_bracket(HAMAKER, 1.0, known) or (0.0, 0.0)
    assert low < 2.0 < high < 2.1


def test_a_guess_beyond_the_limits_is_brought_back_and_usable() -> None:
    guess = expected_bracket(HAMAKER, 0.25, {1.0: (0.5, 0.5), 0.75: (0.1, 0.1)})
    assert guess is not None
    assert guess[0] == HAMAKER.search.limits[0]
    assert critical_value_search(HAMAKER, guess).ask() is not None
