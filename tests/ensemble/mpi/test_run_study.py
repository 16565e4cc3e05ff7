"""Coordination of searches, and studies traced, killed and resumed on real ranks."""

from __future__ import annotations

import json
import math
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ensemble.config.documents import load_study
from ensemble.config.study import Study
from ensemble.mpi.usage import UsageMeter
from ensemble.search.point_search import SearchRun
from ensemble.search.study_planner import StudyPlanner
from ensemble.store import Store
from solver.analysis.run import Outcome
from solver.scene import Shear

SECONDS_TO_DIE = 5


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
        planner.answer(task, answer(task))
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


@settings(deadline=None, max_examples=20)
@given(kept=st.sets(st.integers(0, 40)))
def test_what_is_known_is_never_run_again_and_changes_nothing(study: Study, kept: set[int]) -> None:
    first = StudyPlanner(study, unknown)
    made = run_study(first, 3, lambda out: out - 1)
    known = {task.key: outcome_of(task) for index, task in enumerate(made) if index in kept}
    resumed = StudyPlanner(study, known.get, [task.scene for task in made])
    assert resumed.known_answers == len(known)
    again = run_study(resumed, 2, lambda out: 0)
    assert brackets(resumed) == brackets(first)
    assert not {task.key for task in again} & known.keys()


def test_a_study_with_every_answer_has_no_task(study: Study) -> None:
    first = StudyPlanner(study, unknown)
    made = run_study(first, 2, lambda out: 0)
    known = {task.key: outcome_of(task) for task in made}
    again = StudyPlanner(study, known.get, [task.scene for task in made])
    assert again.done
    assert again.next_task() is None
    assert [point.runs for point in again.boundary().points] == [
        point.runs for point in first.boundary().points
    ]


def test_runs_of_other_scenes_are_no_answers(study: Study) -> None:
    task = StudyPlanner(study, unknown).next_task()
    assert task is not None
    finer = task.scene.model_copy(update={"numerics": task.scene.numerics.model_copy(update={"points": 128})})
    known = {task.key: Outcome.BOUND}
    assert StudyPlanner(study, known.get, [finer]).known_answers == 1, "same place, found by the key"
    assert StudyPlanner(study, {"another": Outcome.BOUND}.get, [finer]).known_answers == 0


def test_workers_get_different_searches_before_any_search_gets_two(study: Study) -> None:
    planner = StudyPlanner(study, unknown)
    tasks = [planner.next_task() for _ in range(6)]
    rates = [task.sweep_value for task in tasks if task is not None]
    assert rates == [0.25, 0.75, 1.5, 0.25, 0.75, 1.5]


def test_the_last_search_is_cut_by_all_workers(study: Study) -> None:
    one_point = load_study("critical-hamaker", ["sweep.values=[0.5]", "search.tolerance=0.01"])
    turns = {}
    for workers in (1, 3):
        planner, turns[workers] = StudyPlanner(one_point, unknown), 0
        while not planner.done:
            tasks = [task for _ in range(workers) if (task := planner.next_task()) is not None]
            for task in tasks:
                planner.answer(task, outcome_of(task))
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
            planner.answer(task, outcome_of(task))
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


def test_finished_searches_tell_the_later_ones_where_to_begin() -> None:
    rates = [0.25, 0.5, 0.75, 1.0, 1.25, 1.5]
    unguided = ["search.guesses=[]", "search.tolerance=0.01"]
    whole = load_study("critical-hamaker", unguided)
    assert list(whole.sweep.values) == rates
    together = len(run_study(StudyPlanner(whole, unknown), 1, lambda out: 0))
    points = [load_study("critical-hamaker", [*unguided, f"sweep.values=[{rate}]"]) for rate in rates]
    apart = sum(len(run_study(StudyPlanner(point, unknown), 1, lambda out: 0)) for point in points)
    assert together < 0.75 * apart


def test_busy_time_counts_until_a_rank_has_nothing_left_to_run() -> None:
    now = 0.0
    usage = UsageMeter(2, lambda: now)
    now = 10.0
    usage.record_run(0, 9.0)
    usage.record_run(1, 5.0)
    usage.record_idle(1)
    now = 12.0
    usage.record_idle(0)  # something was found for it after all
    now = 20.0
    usage.record_run(0, 10.0)
    usage.record_idle(1)
    now = 30.0
    usage.record_run(1, 18.0)  # the last eight seconds of it are after the other rank had run dry
    usage.record_idle(2)
    # ran() is told the moment a run ends, so these two add up to 19 and 5 + 8 of 20 seconds
    assert usage.fractions() == pytest.approx((19 / 20, 13 / 20))
    assert UsageMeter(2, lambda: 0.0).fractions() == ()


# From here on: real ranks, real simulations, real kills.


def points(document: dict[str, Any]) -> list[tuple[Any, Any, Any, Any]]:
    return [
        (point["parameters"], point["bracket"], point["outcomes"], point["status"])
        for point in document["boundary"]
    ]


def made(store: Path) -> dict[str, str]:
    """Time of creation of every committed run."""
    with Store.existing(store) as opened:
        return {summary.key: summary.created.isoformat() for summary in opened.summaries()}


@pytest.mark.parametrize("ranks", [1, 3])
def test_any_number_of_ranks_finds_the_same_brackets(
    launcher, bisect_command, finished_study, tmp_path, ranks
):
    result = launcher.run(ranks, bisect_command(tmp_path / "store"))
    assert result.returncode == 0, result.stderr
    assert points(json.loads(result.stdout)) == points(finished_study.document)


def test_without_a_launcher_it_is_the_same_study(ensemble, bisect_command, finished_study, tmp_path):
    _, _, _, *arguments = bisect_command(tmp_path / "store")
    result = ensemble(*arguments)
    assert result.returncode == 0, result.stderr
    assert points(json.loads(result.stdout)) == points(finished_study.document)


def test_both_ranks_simulate(finished_study):
    assert 0 < finished_study.document["busy_fraction"] <= 1
    assert finished_study.document["busy_fraction"] > 0.5, "one busy rank of two makes at most a half"


def test_a_finished_study_runs_nothing(launcher, bisect_command, finished_study):
    before = made(finished_study.store)
    result = launcher.run(2, bisect_command(finished_study.store))
    document = json.loads(result.stdout)
    assert result.returncode == 0
    assert points(document) == points(finished_study.document)
    assert document["busy_fraction"] is None
    assert made(finished_study.store) == before


def ranks_of(launched: subprocess.Popen[str]) -> dict[int, psutil.Process]:
    found = {}
    for process in psutil.Process(launched.pid).children(recursive=True):
        environment = process.environ()
        if "PMI_RANK" in environment and "ensemble" in process.cmdline():
            found[int(environment["PMI_RANK"])] = process
    return found


def helper_of(launched: subprocess.Popen[str]) -> psutil.Process:
    return ranks_of(launched)[0].parent()


VICTIMS = {
    "launcher": lambda launched: psutil.Process(launched.pid),
    "helper": helper_of,
    "rank 0": lambda launched: ranks_of(launched)[0],
    "rank 1": lambda launched: ranks_of(launched)[1],
}


@pytest.mark.parametrize("victim", VICTIMS)
def test_a_killed_study_leaves_no_process_and_continues_to_the_same_brackets(
    launcher, bisect_command, finished_study, tmp_path, victim
):
    store = tmp_path / "store"
    launched = launcher.start(2, bisect_command(store))
    family = []
    try:
        while not (store / "runs").is_dir() or len(list((store / "runs").iterdir())) < 2:
            assert launched.poll() is None
            time.sleep(0.02)
        time.sleep(random.Random(victim).uniform(0, 1.0))
        family = psutil.Process(launched.pid).children(recursive=True)
        VICTIMS[victim](launched).send_signal(signal.SIGKILL)
        _, alive = psutil.wait_procs(family, timeout=SECONDS_TO_DIE)
        assert not alive
    finally:
        for process in family:
            if process.is_running():
                process.kill()
        launched.kill()
        launched.wait()

    kept = made(store)
    assert kept
    result = launcher.run(2, bisect_command(store))
    assert result.returncode == 0, result.stderr
    assert points(json.loads(result.stdout)) == points(finished_study.document)
    assert kept.items() <= made(store).items(), "a committed run was made again"
    with Store.existing(store) as opened:
        assert opened.check() == []


EXPLODING = """
import sys
from pathlib import Path
from ensemble.mpi.world import world
from ensemble.mpi.run_study import run_study
from ensemble.mpi.store_on_ranks import store_on_ranks
from ensemble.config.documents import load_study

def explode(snapshot):
    raise RuntimeError("the coordinator broke")

communicator = world()
with store_on_ranks(communicator, Path(sys.argv[1])) as store:
    run_study(communicator, load_study("critical-hamaker"), store, explode)
"""


def test_an_exception_beside_the_simulation_ends_the_job(launcher, tmp_path):
    result = launcher.run(2, [sys.executable, "-c", EXPLODING, str(tmp_path / "store")])
    assert result.returncode == 1
    assert "the coordinator broke" in result.stderr
