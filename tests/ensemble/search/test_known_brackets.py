"""Where a critical value is expected, from the points of a boundary that are known."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ensemble.config.documents import load_study
from ensemble.search.critical_value import SearchStatus, Side
from ensemble.search.known_brackets import Bracket, KnownBrackets, Place, expected_bracket
from ensemble.search.point_search import SearchRun
from ensemble.search.study_planner import StudyPlanner
from ensemble.search.study_search import critical_value_search
from ensemble.search.task_queue import RunAnswer
from solver.analysis.run import Outcome
from tests.ensemble.search.study_runs import trace
from tests.ensemble.search.test_certified_studies import is_finer

HAMAKER = load_study("critical-hamaker", ["search.scan=0"])
GRID = HAMAKER.search.grid
SURFACE = load_study(
    "critical-hamaker-surface",
    [
        "sweep.0.values=[0.25, 0.5, 0.75, 1.0, 1.25, 1.5]",
        "sweep.1.values=[0.7, 0.75, 0.8, 0.85, 0.9]",
        "search.tolerance=0.01",
    ],
)


def test_a_whole_study_on_a_known_boundary_takes_few_runs() -> None:
    known: dict[tuple[float, ...], tuple[float, float]] = {}
    runs = []
    for at in HAMAKER.places:
        critical = 0.10 + 0.571 * at[0]  # the published fit
        search = critical_value_search(HAMAKER, expected_bracket(HAMAKER, at, known))
        tried = 0
        while (value := search.ask()) is not None:
            search.tell(value, Side.LOW if value < critical else Side.HIGH)
            tried += 1
        assert search.status is SearchStatus.CONVERGED
        low, high = search.bracket
        assert low is not None
        assert high is not None
        assert low < critical <= high
        known[at] = (low, high)
        runs.append(tried)
    bisection = math.log2(len(GRID.within(*HAMAKER.search.limits)))
    assert sum(runs) <= 0.75 * len(runs) * bisection
    assert max(runs[2:]) <= 6


def test_a_guess_without_neighbors_is_the_study_s_own() -> None:
    assert expected_bracket(HAMAKER, (0.25,), {}) == (0.2, 0.3)
    low, high = expected_bracket(HAMAKER, (0.75,), {}) or (0.0, 0.0)  # between those at 0.5 and 1.0
    assert 0.3 < low < 0.5 < high < 0.7


def test_a_known_point_replaces_the_guess_there() -> None:
    assert expected_bracket(HAMAKER, (0.5,), {(0.5,): (0.36, 0.37)}) == (0.36, 0.37)
    low, high = expected_bracket(HAMAKER, (0.75,), {(0.5,): (1.0, 1.0)}) or (0.0, 0.0)
    assert low < math.sqrt(0.6 * 0.7) / 2 + 1 / 2 < high


def test_a_guess_from_one_neighbor_covers_a_constant_and_a_proportional_boundary() -> None:
    unguided = load_study("critical-hamaker", ["search.guesses=[]"])
    assert expected_bracket(unguided, (0.5,), {}) is None
    low, high = expected_bracket(unguided, (0.5,), {(0.25,): (0.24, 0.24)}) or (0.0, 0.0)
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

    brackets = {(rate,): (boundary(rate), boundary(rate)) for rate in known}
    low, high = expected_bracket(HAMAKER, (at,), brackets) or (0.0, 0.0)
    limit = HAMAKER.search.limits[1]
    assert low <= min(boundary(at), limit) <= high
    assert high < 2 * low
    assert critical_value_search(HAMAKER, (low, high)).ask() is not None


def test_a_third_neighbor_tells_how_the_boundary_bends() -> None:
    def boundary(rate: float) -> float:
        return 0.3 + 0.8 * rate - 0.2 * rate**2

    fine = load_study("critical-hamaker", ["search.tolerance=0.0001"])
    known = {(rate,): (boundary(rate), boundary(rate)) for rate in (0.25, 0.5, 0.75)}
    low, high = expected_bracket(fine, (1.0,), known) or (0.0, 0.0)
    assert low < boundary(1.0) < high < 1.01 * low
    del known[0.25,]
    low, high = expected_bracket(fine, (1.0,), known) or (0.0, 0.0)
    assert not low < boundary(1.0) < high, "the straight line leads past it"


@pytest.mark.parametrize("workers", [1, 2])
def test_a_sweep_along_a_smooth_boundary_takes_three_runs_a_point(workers: int) -> None:
    rates = [0.25 + 1.25 * number / 19 for number in range(20)]
    study = load_study("critical-hamaker", ["search.scan=0", f"sweep.values={rates}"])

    def physics(task: SearchRun) -> RunAnswer:
        assert task.scene.adhesion is not None
        critical = 0.697 * task.at[0] ** 0.935
        outcome = Outcome.BOUND if task.scene.adhesion.hamaker > critical else Outcome.SEPARATED
        return RunAnswer(outcome, sensitive=True)

    planner = StudyPlanner(study, lambda key: None)
    made = trace(planner, physics, workers)
    assert {point.status for point in planner.boundary().points} == {"converged"}
    confirming = sum(map(is_finer, made))
    assert confirming == 2 * len(rates)
    assert len(made) - confirming <= 3 * len(rates)


def test_neighbors_on_both_sides_are_preferred_to_nearer_ones_on_one() -> None:
    known = {(0.8,): (1.0, 1.0), (0.9,): (2.0, 2.0), (1.5,): (2.0, 2.0)}
    low, high = expected_bracket(HAMAKER, (1.0,), known) or (0.0, 0.0)
    assert low < 2.0 < high < 2.1


def test_a_guess_beyond_the_limits_is_brought_back_and_usable() -> None:
    guess = expected_bracket(HAMAKER, (0.25,), {(1.0,): (0.5, 0.5), (0.75,): (0.1, 0.1)})
    assert guess is not None
    assert guess[0] == HAMAKER.search.limits[0]
    assert critical_value_search(HAMAKER, guess).ask() is not None


def surface(at: Place) -> float:
    """A critical value that is no sum of functions of its two parameters."""
    rate, area = at
    return (0.1 + 0.571 * rate) * (2.2 - 1.3 * area)


@given(data=st.data())
def test_neighbors_along_every_parameter_lead_to_the_narrowest_guess(data: st.DataObject) -> None:
    at = data.draw(st.sampled_from(SURFACE.places))
    places = data.draw(st.sets(st.sampled_from(SURFACE.places), min_size=4)) - {at}
    known = KnownBrackets()
    for place in places:
        known.note(place, (surface(place) / 1.004, surface(place) * 1.004))
    guess = expected_bracket(SURFACE, at, known.near(at))
    assert guess is not None
    assert guess[0] <= guess[1]
    if any(sum(a != b for a, b in zip(at, place, strict=True)) == 1 for place in places):
        # With a neighbor along one parameter the guess is not far off.
        assert guess[0] / 1.5 < surface(at) < guess[1] * 1.5


def test_a_corner_across_tells_how_the_boundary_changes() -> None:
    corners = [(0.5, 0.8), (1.0, 0.8), (0.5, 0.9)]
    known: dict[Place, Bracket] = {place: (surface(place), surface(place)) for place in corners}
    low, high = expected_bracket(SURFACE, (1.0, 0.9), known) or (0.0, 0.0)
    assert low < surface((1.0, 0.9)) < high < 1.2 * low
    del known[0.5, 0.8]
    low, high = expected_bracket(SURFACE, (1.0, 0.9), known) or (0.0, 0.0)
    assert high > 1.2 * low


def test_a_bracket_that_is_lost_is_no_neighbor_any_more() -> None:
    known = KnownBrackets()
    known.note((0.5, 0.8), (1.0, 1.1))
    known.note((0.5, 0.8), None)
    known.note((0.5, 0.8), None)
    assert known.near((1.0, 0.8)) == {}


def test_guesses_from_all_directions_save_runs() -> None:
    def physics(task: object) -> RunAnswer:
        scene = task.scene
        at = (scene.flow.rate, scene.vesicles[0].reduced_area)
        return RunAnswer(Outcome.BOUND if scene.adhesion.hamaker > surface(at) else Outcome.SEPARATED)

    planner = StudyPlanner(SURFACE, lambda key: None)
    made = trace(planner, physics, workers=2)
    points = planner.boundary().points
    assert [tuple(point.parameters.values()) for point in points] == list(SURFACE.places)
    for point in points:
        low, high = point.bracket
        assert low is not None
        assert high is not None
        assert low <= surface(tuple(point.parameters.values())) < high
    bisection = math.log2(len(SURFACE.search.grid.within(*SURFACE.search.limits)))
    assert len(made) < 0.5 * bisection * len(points)
