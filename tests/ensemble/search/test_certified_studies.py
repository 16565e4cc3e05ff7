"""Searches of a study and the certifications of their brackets, together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ensemble.config.documents import load_study
from ensemble.config.geometric_grid import GeometricGrid
from ensemble.config.run_key import run_key
from ensemble.config.study import Study
from ensemble.display.result_tables import boundary_cells, boundary_columns
from ensemble.search.boundary import BoundaryPoint
from ensemble.search.point_search import SearchRun
from ensemble.search.study_planner import StudyPlanner
from ensemble.search.task_queue import RunAnswer
from solver.analysis.run import Outcome
from solver.scene import Numerics, Shear
from tests.ensemble.search.study_runs import trace

GRID = GeometricGrid(0.05)
INDICES = GRID.within(0.05, 5.0)


@dataclass(frozen=True)
class TwoNumerics:
    """Outcomes that depend on the numerics: thresholds apart, and a factor of values without an answer."""

    shift: float = 1.0  # finer threshold over coarse threshold
    silence: float = 1.0  # finer runs from threshold/silence up to threshold·silence are undecided

    def __call__(self, task: SearchRun) -> Outcome:
        assert task.scene.adhesion is not None
        assert isinstance(task.scene.flow, Shear)
        critical = 0.1 + 0.571 * task.scene.flow.rate
        ratio = task.scene.adhesion.hamaker / critical
        if is_finer(task):
            ratio /= self.shift
            if 1 / self.silence < ratio < self.silence:
                return Outcome.UNDECIDED
        return Outcome.BOUND if ratio > 1 else Outcome.SEPARATED


def is_finer(task: SearchRun) -> bool:
    return task.scene.numerics.points == 96


def unknown(_: str) -> None:
    return None


def places(tasks: list[SearchRun]) -> list[tuple[tuple[float, ...], float]]:
    return [(task.at, task.value) for task in tasks]


def uncertified_study(sweep_values: str, *changes: str) -> Study:
    sweep = (f"sweep.values={sweep_values}", "search.tolerance=0.05")
    return load_study("critical-hamaker", (*sweep, *changes))


def certified_study(sweep_values: str) -> Study:
    return uncertified_study(sweep_values, "search.certify=true")


@pytest.fixture(scope="module")
def study() -> Study:
    return certified_study("[0.25, 0.75, 1.5]")


def run_study(
    planner: StudyPlanner,
    answer: Callable[[SearchRun], Outcome],
    workers: int = 1,
    choose: Callable[[int], int] = lambda out: 0,
) -> list[SearchRun]:
    """Make all runs of a study, none of which is sensitive."""
    return trace(planner, lambda task: RunAnswer(answer(task)), workers, choose)


def answers(points: list[BoundaryPoint]) -> list[dict[str, Any]]:
    """Points without their runs: workers may try more values than are needed."""
    return [point.model_dump(exclude={"runs"}) for point in points]


numerics_apart = st.builds(
    TwoNumerics, shift=st.floats(0.7, 1.4), silence=st.sampled_from([1.0, 1.0, 1.02, 1.2])
)


@settings(deadline=None, max_examples=20)
@given(physics=numerics_apart, workers=st.integers(1, 9), data=st.data())
def test_certified_points_depend_neither_on_the_workers_nor_on_the_order_of_answers(
    study: Study, physics: TwoNumerics, workers: int, data: st.DataObject
) -> None:
    alone, together = StudyPlanner(study, unknown), StudyPlanner(study, unknown)
    run_study(alone, physics)
    made = run_study(together, physics, workers, lambda out: data.draw(st.integers(0, out - 1)))
    assert answers(together.boundary().points) == answers(alone.boundary().points)
    assert len({task.key for task in made}) == len(made)
    for point in together.boundary().points:
        low, high = point.bracket
        critical = 0.1 + 0.571 * point.parameters["flow.rate"]
        assert low is not None
        assert high is not None
        assert low <= min(critical, critical * physics.shift)
        assert max(critical, critical * physics.shift) < high
        assert point.outcomes == ("separated", "bound")
        assert (point.status, point.certified) == ("converged", True)
        assert point.certified_by == Numerics(points=96, tolerance=1e-6)
        finer_keys = {task.key for task in made if is_finer(task)}
        assert len(finer_keys.intersection(point.runs)) >= 2


@settings(deadline=None, max_examples=15)
@given(physics=numerics_apart, kept=st.sets(st.integers(0, 60)))
def test_what_is_known_is_never_run_again_and_changes_nothing(
    study: Study, physics: TwoNumerics, kept: set[int]
) -> None:
    first = StudyPlanner(study, unknown)
    made = run_study(first, physics, 3, lambda out: out - 1)
    known = {task.key: RunAnswer(physics(task)) for index, task in enumerate(made) if index in kept}
    resumed = StudyPlanner(study, known.get, places(made))
    again = run_study(resumed, physics, 2)
    assert answers(resumed.boundary().points) == answers(first.boundary().points)
    assert not {task.key for task in again} & known.keys()
    assert resumed.known_answers == len(known)


def test_asked_for_later_a_certification_adds_only_its_own_runs(study: Study) -> None:
    physics = TwoNumerics(shift=1.2)
    plain = StudyPlanner(uncertified_study("[0.25, 0.75, 1.5]"), unknown)
    searched = run_study(plain, physics)
    assert not any(is_finer(task) for task in searched)
    assert {(point.certified, point.certified_by) for point in plain.boundary().points} == {(False, None)}

    known = {task.key: RunAnswer(physics(task)) for task in searched}
    certified = StudyPlanner(study, known.get, places(searched))
    added = run_study(certified, physics, 2)
    assert added
    assert all(is_finer(task) for task in added)

    known |= {task.key: RunAnswer(physics(task)) for task in added}
    again = StudyPlanner(study, known.get, places([*searched, *added]))
    assert again.done
    assert again.next_task() is None
    assert again.known_answers == len(searched) + len(added)
    assert again.runs_left == 0
    assert again.boundary().points == certified.boundary().points


def test_a_point_is_its_search_until_both_ends_are_certified(study: Study) -> None:
    one_point = certified_study("[0.5]")
    planner, physics = StudyPlanner(one_point, unknown), TwoNumerics()
    while (task := planner.next_task()) is not None and not is_finer(task):
        planner.answer(task, RunAnswer(physics(task)))
    other = planner.next_task()
    assert task is not None
    assert other is not None
    assert planner.next_task() is None
    (point,) = planner.boundary().points
    assert (task.value, other.value) == point.bracket, "both ends at once"
    assert (point.status, point.certified, point.certified_by) == ("certifying", False, None)
    assert planner.runs_left == 2
    planner.answer(task, RunAnswer(Outcome.FAILED))
    assert planner.boundary().points[0].bracket == point.bracket
    assert planner.boundary().points[0].status == "certifying"


def test_what_cannot_be_certified_says_so_and_keeps_its_bracket(study: Study) -> None:
    physics = TwoNumerics()
    plain = StudyPlanner(uncertified_study("[0.25, 0.75, 1.5]"), unknown)
    run_study(plain, physics)
    failing = StudyPlanner(study, unknown)
    run_study(failing, lambda task: Outcome.FAILED if is_finer(task) else physics(task), 2)
    for point, searched in zip(failing.boundary().points, plain.boundary().points, strict=True):
        assert (point.status, point.certified, point.certified_by) == ("uncertified", False, None)
        assert (point.bracket, point.outcomes) == (searched.bracket, searched.outcomes)


def test_a_contradiction_at_the_finer_numerics_is_reported(study: Study) -> None:
    physics = TwoNumerics()
    values: dict[float, list[float]] = {}
    swapped = {Outcome.BOUND: Outcome.SEPARATED, Outcome.SEPARATED: Outcome.BOUND}

    def contrary(task: SearchRun) -> Outcome:
        """Two finer runs of a point, those at the ends of its bracket, come out on the wrong sides."""
        if is_finer(task):
            values.setdefault(task.at[0], []).append(task.value)
            if len(values[task.at[0]]) <= 2:
                return swapped[physics(task)]
        return physics(task)

    planner = StudyPlanner(study, unknown)
    run_study(planner, contrary, 8)
    for point in planner.boundary().points:
        assert (point.status, point.certified) == ("non-monotone", False)
        low, high = point.bracket
        assert low is not None
        assert high is not None
        assert GRID.index(high) - GRID.index(low) == 3


def test_a_late_answer_that_contradicts_is_bracketed_before_the_certification_goes_on() -> None:
    one_point = certified_study("[0.5]")
    planner, physics = StudyPlanner(one_point, unknown), TwoNumerics()
    late = None
    out: list[SearchRun] = []
    while not any(map(is_finer, out)):
        while (task := planner.next_task()) is not None:
            out.append(task)
        certain = out.pop(0)
        planner.answer(certain, RunAnswer(physics(certain)))
        for unneeded in planner.unneeded_tasks():
            if late is None:
                late = unneeded  # it does not stop
            elif unneeded is not late:
                planner.cancelled(unneeded)
                out.remove(unneeded)
        out = [task for task in out if task is not late]
    assert late is not None
    assert all(map(is_finer, out))
    low, _ = planner.boundary().points[0].bracket
    assert low is not None
    planner.answer(late, RunAnswer(Outcome.BOUND if late.value <= low else Outcome.SEPARATED))
    assert set(out) <= set(planner.unneeded_tasks())
    for task in out:
        planner.cancelled(task)
    first = planner.next_task()
    assert first is not None
    assert not is_finer(first)
    planner.answer(first, RunAnswer(physics(first)))
    run_study(planner, physics, 1)
    assert planner.done
    (point,) = planner.boundary().points
    assert point.certified, "the bracket rests on the runs of the search, and they agree"
    assert len(point.changes) == 1
    assert point.other_changes == point.incidental_changes
    assert len(point.incidental_changes) == 2


def test_certifying_comes_before_a_second_task_of_one_search() -> None:
    two_points = certified_study("[0.5, 1.0]")
    planner, physics = StudyPlanner(two_points, unknown), TwoNumerics()
    tasks: list[SearchRun] = []
    while not any(map(is_finer, tasks)):
        task = planner.next_task()
        assert task is not None
        tasks.append(task)
        if task.at[0] == 0.5 and not is_finer(task):
            planner.answer(task, RunAnswer(physics(task)))
    following = []
    for _ in range(3):
        task = planner.next_task()
        assert task is not None
        following.append(task)
    assert tasks[-1].at == (0.5,)
    assert [(task.at[0], is_finer(task)) for task in following] == [
        (1.0, False),
        (0.5, True),
        (1.0, False),
    ]


def test_a_search_that_others_finish_meanwhile_is_certified_at_once() -> None:
    one_point = certified_study("[0.5]")
    known: dict[str, RunAnswer] = {}
    planner, physics = StudyPlanner(one_point, known.get), TwoNumerics()
    out = planner.next_task()
    scenes = [one_point.scene_at((0.5,), GRID.value(index)) for index in INDICES]
    tasks = [
        SearchRun(at=(0.5,), value=GRID.value(i), scene=scene, key=run_key(scene))
        for i, scene in zip(INDICES, scenes, strict=True)
    ]
    known.update({task.key: RunAnswer(physics(task)) for task in tasks})
    # The scan needs the run that is out, and nothing else: all other values are known.
    assert planner.next_task() is None
    assert out is not None
    planner.answer(out, RunAnswer(physics(out)))
    task = planner.next_task()
    assert task is not None
    assert is_finer(task)


def test_tables_name_the_numerics_and_old_documents_are_read() -> None:
    document = {
        "parameters": {"flow.rate": 0.5},
        "bracket": (0.25, 1.0),
        "outcomes": ("separated", "bound"),
        "status": "converged",
        "certified": False,
        "runs": [],
    }
    old = BoundaryPoint.model_validate(document)
    new = old.model_copy(update={"certified": True, "certified_by": Numerics(points=96, tolerance=1e-6)})
    assert BoundaryPoint.model_validate_json(new.model_dump_json()) == new
    columns = boundary_columns([old, new])
    shown = [dict(zip(columns, boundary_cells(p, columns), strict=True)) for p in (old, new)]
    assert [cells["certified by"] for cells in shown] == ["–", "96 points, 1e-06"]
