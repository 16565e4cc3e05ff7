"""The order of a study's runs, and that its brackets depend on nothing but the physics."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ensemble.config.documents import load_study
from ensemble.config.run_key import run_key
from ensemble.config.study import Study
from ensemble.display.result_tables import boundary_cells, boundary_columns
from ensemble.search.point_search import SearchRun
from ensemble.search.study_planner import StudyPlanner
from ensemble.search.task_queue import RunAnswer
from solver.analysis.run import Outcome
from solver.scene import Shear


def critical(rate: float) -> float:
    """A boundary like the real one."""
    return 0.1 + 0.571 * rate


def outcome_of(task: SearchRun) -> Outcome:
    assert task.scene.adhesion is not None
    assert isinstance(task.scene.flow, Shear)
    bound = task.scene.adhesion.hamaker > critical(task.scene.flow.rate)
    return Outcome.BOUND if bound else Outcome.SEPARATED


def unknown(_: str) -> None:
    return None


@pytest.fixture(scope="module")
def study() -> Study:
    return load_study("critical-hamaker", ["sweep.values=[0.25, 0.75, 1.5]", "search.tolerance=0.05"])


def run_study(
    planner: StudyPlanner,
    workers: int,
    choose: Callable[[int], int],
    answer: Callable[[SearchRun], Outcome] = outcome_of,
) -> list[SearchRun]:
    """Keep workers busy, finishing at each turn the task that `choose` picks among those out."""
    out: list[SearchRun] = []
    made: list[SearchRun] = []
    while not planner.done:
        while len(out) < workers and (task := planner.next_task()) is not None:
            out.append(task)
        task = out.pop(choose(len(out)))
        made.append(task)
        planner.answer(task, RunAnswer(answer(task)))
        for unneeded in planner.unneeded_tasks():
            out.remove(unneeded)
            planner.cancelled(unneeded)
    assert not out
    return made


def brackets(planner: StudyPlanner) -> list[tuple[float | None, float | None]]:
    return [point.bracket for point in planner.boundary().points]


@settings(deadline=None, max_examples=40)
@given(workers=st.integers(1, 9), data=st.data())
def test_brackets_depend_neither_on_the_workers_nor_on_the_order_of_answers(
    study: Study, workers: int, data: st.DataObject
) -> None:
    alone, together = StudyPlanner(study, unknown), StudyPlanner(study, unknown)
    run_study(alone, 1, lambda out: 0)
    made = run_study(together, workers, lambda out: data.draw(st.integers(0, out - 1)))
    assert brackets(together) == brackets(alone)
    assert len({task.key for task in made}) == len(made)
    for point in together.boundary().points:
        low, high = point.bracket
        assert low is not None
        assert high is not None
        assert low <= critical(point.parameters["flow.rate"]) < high
        assert high / low - 1 < study.search.tolerance
        assert point.status == "converged"
        assert point.outcomes == ("separated", "bound")


guesses = st.dictionaries(
    st.sampled_from([0.25, 0.5, 0.75, 1.5]),
    st.tuples(st.floats(0.01, 20.0), st.floats(1.01, 50.0)),
    max_size=4,
).map(lambda all_: [f"{{at = {at}, bracket = [{low}, {low * ratio}]}}" for at, (low, ratio) in all_.items()])


@pytest.mark.parametrize("scan", [0, 2])
@settings(deadline=None, max_examples=12)
@given(guesses=guesses, workers=st.integers(1, 9), data=st.data())
def test_brackets_do_not_depend_on_guesses_right_or_wrong(
    scan: int, guesses: list[str], workers: int, data: st.DataObject
) -> None:
    changes = ["sweep.values=[0.25, 0.75, 1.5]", "search.tolerance=0.01", f"search.scan={scan}"]
    unguided, guided = (
        StudyPlanner(load_study("critical-hamaker", [*changes, f"search.guesses=[{each}]"]), unknown)
        for each in ("", ", ".join(guesses))
    )
    run_study(unguided, 1, lambda out: 0)
    run_study(guided, workers, lambda out: data.draw(st.integers(0, out - 1)))
    ours, theirs = (
        [point.model_dump(exclude={"runs"}) for point in planner.boundary().points]
        for planner in (guided, unguided)
    )
    assert ours == theirs


@settings(deadline=None, max_examples=20)
@given(kept=st.sets(st.integers(0, 40)))
def test_what_is_known_is_never_run_again_and_changes_nothing(study: Study, kept: set[int]) -> None:
    first = StudyPlanner(study, unknown)
    made = run_study(first, 3, lambda out: out - 1)
    known = {task.key: RunAnswer(outcome_of(task)) for index, task in enumerate(made) if index in kept}
    resumed = StudyPlanner(study, known.get, [(task.at, task.value) for task in made])
    assert resumed.known_answers == len(known)
    again = run_study(resumed, 2, lambda out: 0)
    assert brackets(resumed) == brackets(first)
    assert not {task.key for task in again} & known.keys()


def test_a_study_with_every_answer_has_no_task(study: Study) -> None:
    first = StudyPlanner(study, unknown)
    made = run_study(first, 2, lambda out: 0)
    known = {task.key: RunAnswer(outcome_of(task)) for task in made}
    again = StudyPlanner(study, known.get, [(task.at, task.value) for task in made])
    assert again.done
    assert again.next_task() is None
    assert [point.runs for point in again.boundary().points] == [
        point.runs for point in first.boundary().points
    ]


def test_runs_of_other_scenes_are_no_answers(study: Study) -> None:
    task = StudyPlanner(study, unknown).next_task()
    assert task is not None
    place = (task.at, task.value)
    known = {task.key: RunAnswer(Outcome.BOUND)}
    assert StudyPlanner(study, known.get, [place]).known_answers == 1, "same place, found by the key"
    assert StudyPlanner(study, {"another": RunAnswer(Outcome.BOUND)}.get, [place]).known_answers == 0


def test_workers_get_different_searches_before_any_search_gets_two(study: Study) -> None:
    planner = StudyPlanner(study, unknown)
    tasks = [planner.next_task() for _ in range(6)]
    rates = [task.at[0] for task in tasks if task is not None]
    assert rates == [0.25, 0.75, 1.5, 0.25, 0.75, 1.5]


def test_the_last_search_is_cut_by_all_workers(study: Study) -> None:
    one_point = load_study("critical-hamaker", ["sweep.values=[0.5]", "search.tolerance=0.01"])
    turns = {}
    for workers in (1, 3):
        planner, turns[workers] = StudyPlanner(one_point, unknown), 0
        while not planner.done:
            tasks = [task for _ in range(workers) if (task := planner.next_task()) is not None]
            for task in tasks:
                planner.answer(task, RunAnswer(outcome_of(task)))
            turns[workers] += 1
    assert turns[3] <= math.ceil(0.7 * turns[1])


def test_a_slow_run_near_the_critical_value_is_not_waited_for() -> None:
    one_point = load_study("critical-hamaker", ["sweep.values=[0.5]", "search.tolerance=0.05"])
    planner = StudyPlanner(one_point, unknown)
    slow = None
    while (task := planner.next_task()) is not None:
        if slow is None and abs(task.value / critical(0.5) - 1) < 0.05:
            slow = task  # it never comes back
        else:
            planner.answer(task, RunAnswer(outcome_of(task)))
    assert slow is not None
    low, high = planner.boundary().points[0].bracket
    assert low is not None
    assert high is not None
    if slow in planner.unneeded_tasks():
        assert planner.done
    else:
        assert low < slow.value < high < low * (1 + one_point.search.tolerance) ** 2


def test_failed_and_contradictory_runs_are_reported_not_averaged(study: Study) -> None:
    failing = StudyPlanner(study, unknown)
    run_study(failing, 2, lambda out: 0, answer=lambda task: Outcome.FAILED)
    assert {point.status for point in failing.boundary().points} == {"failed"}

    reversed_outcomes = {Outcome.BOUND: Outcome.SEPARATED, Outcome.SEPARATED: Outcome.BOUND}
    contrary = StudyPlanner(study, unknown)
    run_study(contrary, 2, lambda out: 0, answer=lambda task: reversed_outcomes[outcome_of(task)])
    assert all(point.status in ("non-monotone", "unbracketed") for point in contrary.boundary().points)


def test_windows_are_found_listed_and_shown() -> None:
    one_point = load_study("critical-hamaker", ["sweep.values=[0.5]", "search.scan=4"])
    edges = (0.1, 0.25, 0.3635)

    def alternating(task: SearchRun) -> Outcome:
        return Outcome.BOUND if sum(task.value > edge for edge in edges) % 2 else Outcome.SEPARATED

    planner = StudyPlanner(one_point, unknown)
    run_study(planner, 2, lambda out: out - 1, answer=alternating)
    (point,) = planner.boundary().points
    assert point.status == "non-monotone"
    assert [change.outcomes for change in point.changes] == [
        ("separated", "bound"),
        ("bound", "separated"),
        ("separated", "bound"),
    ]
    for change, edge in zip(point.changes, edges, strict=True):
        assert change.bracket[0] <= edge < change.bracket[1] < change.bracket[0] * 1.01
    assert point.bracket == point.changes[-1].bracket
    assert point.other_changes == point.changes[:-1]
    assert point.scanned is not None
    assert point.scanned.values == len(point.scanned.looked_at)
    assert 1 < point.scanned.widest_unseen < 10**0.25 * 1.01
    columns = boundary_columns([point])
    cells = dict(zip(columns, boundary_cells(point, columns), strict=True))
    assert cells["other changes"].count("bound | separated") == 1
    assert cells["scanned"].startswith(f"{point.scanned.values}, unseen")


def test_without_a_scan_a_search_ends_with_the_change_that_it_finds(study: Study) -> None:
    plain = load_study("critical-hamaker", ["sweep.values=[0.5]", "search.scan=0"])
    scanning = load_study("critical-hamaker", ["sweep.values=[0.5]"])
    planners = [StudyPlanner(study, unknown) for study in (plain, scanning)]
    runs = [len(run_study(planner, 1, lambda out: 0)) for planner in planners]
    points = [planner.boundary().points[0] for planner in planners]
    assert points[0].bracket == points[1].bracket
    assert (points[0].scanned, len(points[0].changes)) == (None, 1)
    assert runs[0] < runs[1]


@pytest.mark.parametrize("scan", [0, 2])
def test_the_finest_tolerance_begins_at_once_and_takes_what_is_known(scan: int) -> None:
    finest = load_study(
        "critical-hamaker", ["sweep.values=[0.5]", "search.tolerance=1e-9", f"search.scan={scan}"]
    )
    planner = StudyPlanner(finest, unknown, [(0.5, 0.12345)])  # not on the grid
    run_study(planner, 1, lambda out: 0)
    (point,) = planner.boundary().points
    low, high = point.bracket
    assert low is not None
    assert high is not None
    assert low <= critical(0.5) < high < low * (1 + 1e-9)


def test_finished_searches_tell_the_later_ones_where_to_begin() -> None:
    rates = [0.25, 0.5, 0.75, 1.0, 1.25, 1.5]
    unguided = ["search.guesses=[]", "search.tolerance=0.01", "search.scan=0"]
    whole = load_study("critical-hamaker", unguided)
    assert list(whole.sweep[0].values) == rates
    together = len(run_study(StudyPlanner(whole, unknown), 1, lambda out: 0))
    points = [load_study("critical-hamaker", [*unguided, f"sweep.values=[{rate}]"]) for rate in rates]
    apart = sum(len(run_study(StudyPlanner(point, unknown), 1, lambda out: 0)) for point in points)
    assert together < 0.75 * apart


def test_a_search_that_has_answers_begins_where_the_finished_ones_tell_it_to() -> None:
    changes = ["search.guesses=[]", "search.scan=0"]
    first = StudyPlanner(load_study("critical-hamaker", [*changes, "sweep.values=[0.5, 0.75, 1.0]"]), unknown)
    made = [*run_study(first, 1, lambda out: 0)]
    whole = load_study("critical-hamaker", [*changes, "sweep.values=[0.5, 0.75, 1.0, 1.25]"])
    far = whole.search.grid.value(whole.search.grid.nearest(4.0))
    scene = whole.scene_at((1.25,), far)
    made.append(SearchRun(at=(1.25,), value=far, scene=scene, key=run_key(scene)))
    known = {task.key: RunAnswer(outcome_of(task)) for task in made}
    planner = StudyPlanner(whole, known.get, [(task.at, task.value) for task in made])
    assert planner.known_answers == len(made)
    assert len(run_study(planner, 1, lambda out: 0)) <= 3
