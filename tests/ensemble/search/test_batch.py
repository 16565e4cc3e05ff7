"""Batches of independent scenes: each is run once, whatever becomes of it, on all ranks."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from ensemble.config.documents import load_scene
from ensemble.config.run_key import run_key
from ensemble.search.batch import Batch, expected_work
from ensemble.search.task_queue import RunAnswer
from ensemble.store import Store
from solver.analysis.run import Outcome

RATES = (0.3, 0.5, 0.7)
SCENES = [load_scene("vesicle-shear", [f"flow.rate={rate}"]) for rate in RATES]


def unknown(_: str) -> None:
    return None


def test_the_longest_run_comes_first() -> None:
    short, long, wide = (
        load_scene("doublet-quiescent", changes)
        for changes in (["horizon=10.0"], ["horizon=20.0"], ["horizon=10.0", "numerics.points=128"])
    )
    batch = Batch([short, long, wide], unknown)
    first, second, third = (batch.next_task() for _ in range(3))
    assert [first.scene, second.scene, third.scene] == [wide, long, short]
    assert batch.next_task() is None


def test_a_start_that_is_relaxed_first_is_work_too() -> None:
    placed, relaxed = (load_scene("doublet-trap", [f"start.relaxed={value}"]) for value in ("false", "true"))
    assert expected_work(relaxed) > expected_work(placed)


def test_equal_scenes_are_run_once_and_known_ones_never() -> None:
    known = {run_key(SCENES[0]): RunAnswer(Outcome.STEADY)}
    batch = Batch([*SCENES, SCENES[1]], known.get)
    assert batch.known_answers == 1
    assert batch.runs_left == 2
    tasks = [batch.next_task(), batch.next_task()]
    assert batch.next_task() is None
    assert {task.scene.flow.rate for task in tasks} == set(RATES[1:])


def test_it_is_done_when_every_run_has_come_back_even_a_failed_one() -> None:
    batch = Batch(SCENES, unknown)
    tasks = [batch.next_task() for _ in SCENES]
    batch.answer(tasks[0], RunAnswer(Outcome.STEADY))
    batch.answer(tasks[1], RunAnswer(Outcome.FAILED))
    assert not batch.done
    batch.cancelled(tasks[2])
    assert not batch.done
    again = batch.next_task()
    assert again == tasks[2]
    batch.answer(again, RunAnswer(Outcome.STEADY))
    assert batch.done
    assert batch.next_task() is None


RUNNING = """
import json, sys
from pathlib import Path
from ensemble.mpi.world import abort_guard, world
from ensemble.mpi.run_study import run_batch
from ensemble.mpi.store_on_ranks import store_on_ranks
from ensemble.config.documents import load_scene

communicator = world()
with abort_guard(communicator):
    coarse = ["numerics.points=32"]
    scenes = [
        load_scene("vesicle-shear", [f"flow.rate={rate}", f"numerics.work_limit={limit}", *coarse])
        for rate, limit in [(0.3, 10000), (0.5, 10000), (0.7, 10000), (0.9, 20)]
    ]
    with store_on_ranks(communicator, Path(sys.argv[1])) as store:
        seen = []
        usage = run_batch(communicator, scenes, store, lambda progress: seen.append(set(progress.running)))
        if communicator.Get_rank() == 0:
            print(json.dumps({
                "runs": usage.runs, "most": max(map(len, seen)), "last": len(seen[-1]), "times": len(seen),
                "seconds": usage.wall_seconds, "busy": usage.busy_fractions,
            }))
"""


def test_two_ranks_run_a_batch_and_do_not_run_it_again(launcher, tmp_path: Path) -> None:
    store = tmp_path / "store"
    documents = []
    for _ in range(2):
        result = launcher.run(2, [sys.executable, "-c", RUNNING, str(store)])
        assert result.returncode == 0, result.stderr
        documents.append(json.loads(result.stdout))
    first, again = documents
    assert first["runs"] == 4
    assert first["most"] == 2, "both ranks simulate"
    assert first["times"] <= 2 + first["seconds"] / 0.5, "progress is shown at most twice a second"
    assert first["last"] == 0, "and at the end"
    assert (again["runs"], again["most"], again["busy"]) == (0, 0, [])
    with Store.existing(store) as opened:
        outcomes = {summary.scene.flow.rate: summary.outcome for summary in opened.summaries()}
    assert outcomes == dict.fromkeys((0.3, 0.5, 0.7), Outcome.STEADY) | {0.9: Outcome.FAILED}
