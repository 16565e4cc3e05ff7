"""Sensitive ends of brackets are run again at finer numerics, and the answer depends on outcomes alone."""

from __future__ import annotations

from dataclasses import dataclass

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
from tests.ensemble.search.study_runs import trace
from tests.ensemble.search.test_certified_studies import answers, is_finer, unknown


@dataclass(frozen=True)
class SensitivePhysics:
    """A threshold that finer numerics move; runs within a factor of the first one are sensitive."""

    shift: float = 1.0
    sensitive_within: float = 1.2
    silent: bool = False  # whether finer runs are undecided

    def __call__(self, task: SearchRun) -> RunAnswer:
        assert task.scene.adhesion is not None
        assert isinstance(task.scene.flow, Shear)
        ratio = task.scene.adhesion.hamaker / (0.1 + 0.571 * task.scene.flow.rate)
        sensitive = 1 / self.sensitive_within < ratio < self.sensitive_within
        if is_finer(task):
            if self.silent:
                return RunAnswer(Outcome.UNDECIDED, sensitive)
            ratio /= self.shift
        return RunAnswer(Outcome.BOUND if ratio > 1 else Outcome.SEPARATED, sensitive)


def study_of(*changes: str) -> Study:
    return load_study(
        "critical-hamaker", ["sweep.values=[0.25, 0.75, 1.5]", "search.tolerance=0.05", *changes]
    )


@pytest.mark.parametrize("certify", ["false", "true"])
@pytest.mark.parametrize("scan", [1, 2])
@settings(deadline=None, max_examples=20)
@given(
    physics=st.builds(SensitivePhysics, st.floats(0.8, 1.25), st.sampled_from([1.001, 1.02, 1.1, 1.5])),
    workers=st.integers(1, 9),
    data=st.data(),
)
def test_points_depend_neither_on_workers_nor_on_order_nor_on_guesses(
    certify: str, scan: int, physics: SensitivePhysics, workers: int, data: st.DataObject
) -> None:
    changes = [f"search.certify={certify}", f"search.scan={scan}"]
    alone = StudyPlanner(study_of(*changes), unknown)
    together = StudyPlanner(study_of(*changes, "search.guesses=[]"), unknown)
    trace(alone, physics)
    made = trace(together, physics, workers, lambda out: data.draw(st.integers(0, out - 1)))
    assert answers(together.boundary().points) == answers(alone.boundary().points)
    assert len({task.key for task in made}) == len(made)


@settings(deadline=None, max_examples=20)
@given(shift=st.floats(0.8, 1.25), kept=st.sets(st.integers(0, 60)))
def test_what_is_known_is_never_run_again_and_changes_nothing(shift: float, kept: set[int]) -> None:
    study, physics = study_of("search.certify=true"), SensitivePhysics(shift)
    first = StudyPlanner(study, unknown)
    made = trace(first, physics, 3, lambda out: out - 1)
    known = {task.key: physics(task) for index, task in enumerate(made) if index in kept}
    resumed = StudyPlanner(study, known.get, [(task.at, task.value) for task in made])
    again = trace(resumed, physics, 2)
    assert answers(resumed.boundary().points) == answers(first.boundary().points)
    assert not {task.key for task in again} & known.keys()
    assert resumed.known_answers == len(known)


def test_only_sensitive_ends_are_run_again_and_what_agrees_stands() -> None:
    steady, sensitive = SensitivePhysics(sensitive_within=1.0), SensitivePhysics()
    planners = [StudyPlanner(study_of(), unknown) for _ in range(2)]
    plain = trace(planners[0], steady)
    made = trace(planners[1], sensitive)
    assert not any(map(is_finer, plain))
    assert [task.key for task in made if not is_finer(task)] == [task.key for task in plain]
    for before, after in zip(*(planner.boundary().points for planner in planners), strict=True):
        assert (after.bracket, after.status, before.confirmed) == (before.bracket, "converged", [])
        assert tuple(each.value for each in after.confirmed) == after.bracket
        assert all(each.outcome == each.finer_outcome for each in after.confirmed)
        assert set(after.runs) > set(before.runs)
        assert after.scanned == before.scanned
    confirmed, columns = planners[1].boundary().points[0], boundary_columns(planners[1].boundary().points)
    cells = dict(zip(columns, boundary_cells(confirmed, columns), strict=True))
    assert cells["confirmed"] == "2 of 2"
    assert "confirmed" not in boundary_columns(planners[0].boundary().points)


@pytest.mark.parametrize("shift", [0.85, 0.97, 1.03, 1.2])
def test_where_finer_runs_come_out_otherwise_they_count(shift: float) -> None:
    planner = StudyPlanner(study_of(), unknown)
    trace(planner, SensitivePhysics(shift, sensitive_within=1.5))
    for point in planner.boundary().points:
        low, high = point.bracket
        assert low is not None
        assert high is not None
        critical = shift * (0.1 + 0.571 * point.parameters["flow.rate"])
        assert low < critical < high < 1.05 * low
        assert (point.status, point.outcomes) == ("converged", ("separated", "bound"))
        moved = [each for each in point.confirmed if each.outcome != each.finer_outcome]
        assert {low, high} <= {each.value for each in point.confirmed}
        assert len(moved) == len(point.confirmed) - 2
        assert moved or 0.96 < shift < 1.04, "a shift below the spacing may lie within the bracket"


def test_ends_that_finer_runs_leave_undecided_are_no_ends() -> None:
    planner = StudyPlanner(study_of("sweep.values=[0.5]"), unknown)
    trace(planner, SensitivePhysics(sensitive_within=1.06, silent=True))
    (point,) = planner.boundary().points
    assert point.status == "undecided"
    assert {each.finer_outcome for each in point.confirmed} == {"undecided"}


def test_certifying_takes_the_runs_that_have_confirmed() -> None:
    confirming, certifying = (StudyPlanner(study_of(*c), unknown) for c in ((), ("search.certify=true",)))
    made = trace(confirming, SensitivePhysics())
    assert {task.key for task in trace(certifying, SensitivePhysics())} == {task.key for task in made}
    assert all(point.certified for point in certifying.boundary().points)


def test_a_point_says_that_its_ends_are_being_confirmed() -> None:
    planner, physics = StudyPlanner(study_of("sweep.values=[0.5]"), unknown), SensitivePhysics()
    while (task := planner.next_task()) is not None and not is_finer(task):
        planner.answer(task, physics(task))
    assert task is not None
    assert planner.boundary().points[0].status == "confirming"
    assert planner.runs_left == 2
    planner.cancelled(task)
    assert planner.next_task() == task


def test_the_finest_numerics_have_no_finer_ones_to_confirm_them() -> None:
    finest = study_of("scene.numerics.points=1024")
    planner = StudyPlanner(finest, unknown)
    made = trace(planner, SensitivePhysics())
    assert {task.scene.numerics.points for task in made} == {1024}
    assert {point.status for point in planner.boundary().points} == {"converged"}
    assert {run_key(task.scene) for task in made} == {
        key for p in planner.boundary().points for key in p.runs
    }


def test_a_bracket_leads_to_guesses_before_its_ends_are_confirmed() -> None:
    study = study_of("search.scan=0", "sweep.values=[0.5, 0.75, 1.0]", "search.tolerance=0.01")
    planner, physics = StudyPlanner(study, unknown), SensitivePhysics()
    confirming = []
    while (task := planner.next_task()) is not None and task.at != (1.0,):
        if is_finer(task):
            confirming.append(task)
        else:
            planner.answer(task, physics(task))
    assert {each.at for each in confirming} == {(0.5,), (0.75,)}
    assert task is not None
    assert task.value == pytest.approx(0.671, rel=0.01), "on the line through both"
