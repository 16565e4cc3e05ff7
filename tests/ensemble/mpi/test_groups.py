"""Runs that several ranks share: the results of one rank, whatever the groups, and jobs that end."""

from __future__ import annotations

import json
import signal
import sys
import time

import psutil
import pytest

from ensemble.config.documents import load_scene
from ensemble.errors import BadInput
from ensemble.mpi.groups import chosen_ranks
from ensemble.mpi.scaling_model import LEAST_EFFICIENCY, MEASURED
from ensemble.store import Store
from tests.conftest import ENSEMBLE
from tests.ensemble.mpi.launched_ranks import ranks_of

SECONDS_TO_END = 60  # far less on a machine that has nothing else to do

COARSE = ("--set=numerics.points=32", "--set=numerics.tolerance=1e-2")
# Coarse, but fine enough to decide every value that the search tries, on any number of ranks.
STUDY = (
    "--set=sweep.values=[1.25]",
    "--set=scene.numerics.points=32",
    "--set=scene.numerics.tolerance=1e-3",
    "--tolerance=0.4",
)


SPLITTING = """
from ensemble.mpi.groups import Groups
from ensemble.mpi.world import abort_guard, world
communicator = world()
with abort_guard(communicator):
    groups = Groups.of(communicator, 2)
    found = groups.everyone.gather((groups.group.Get_size(), groups.group.Get_rank(), groups.leaders is None))
    leaders = groups.leaders.Get_size() if groups.leaders else None
    groups.free()
    if communicator.Get_rank() == 0:
        print(found, leaders)
"""


def test_the_last_group_has_what_is_left(launcher):
    result = launcher.run(5, [sys.executable, "-c", SPLITTING])
    assert result.returncode == 0, result.stderr
    pair = [(2, 0, False), (2, 1, True)]
    assert result.stdout.strip() == f"{[*pair, *pair, (1, 0, False)]} 3"


@pytest.mark.parametrize(
    ("requested", "message"),
    [
        ("0", "0 — must be from 1 to 4"),
        ("5", "5 — must be from 1 to 4"),
        ("many", "'many' — must be a number"),
    ],
)
def test_impossible_numbers_of_ranks_are_refused(requested, message):
    with pytest.raises(BadInput, match=f"--ranks-per-run: {message}"):
        chosen_ranks(requested, load_scene("doublet-shear"), 4)


def test_automatic_groups_are_efficient_and_grow_with_the_scene():
    pair = load_scene("doublet-shear")
    many = load_scene("suspension-shear")
    assert chosen_ranks("2", pair, 4) == 2
    assert chosen_ranks("auto", pair, 64) <= chosen_ranks("auto", many, 64)
    for points in (128, 1_000, 10_000, 100_000):
        ranks = MEASURED.recommended_ranks(points, 10_000)
        assert ranks == 1 or MEASURED.efficiency(points, ranks) >= LEAST_EFFICIENCY
        assert MEASURED.efficiency(points, ranks + 1) < LEAST_EFFICIENCY
    assert MEASURED.recommended_ranks(1e6, 10_000) > MEASURED.recommended_ranks(1e4, 10_000)


def test_bad_numbers_of_ranks_are_refused_before_anything_is_written(launcher, tmp_path):
    store = tmp_path / "store"
    for command in (["bisect"], ["run", "doublet-shear"]):
        result = launcher.run(2, [*ENSEMBLE, *command, "--ranks-per-run=3", f"--store={store}"])
        assert result.returncode == 2
        assert "--ranks-per-run: 3" in result.stderr
        assert result.stdout == ""
        assert not store.exists()


def brackets(stdout: str) -> list[tuple]:
    return [(point["bracket"], point["outcomes"]) for point in json.loads(stdout)["boundary"]]


@pytest.mark.long
def test_groups_find_the_brackets_of_single_ranks_to_the_last_bit(launcher, tmp_path):
    """Three ranks in groups of two: one group of two, and one of a single rank."""
    command = [*ENSEMBLE, "bisect", *STUDY, "--json"]
    alone = launcher.run(1, [*command, "--store", str(tmp_path / "alone")])
    assert alone.returncode == 0, alone.stderr
    store = tmp_path / "grouped"
    grouped = launcher.run(3, [*command, "--ranks-per-run=2", "--store", str(store)])
    assert grouped.returncode == 0, grouped.stderr
    assert brackets(grouped.stdout) == brackets(alone.stdout)
    with Store.existing(store) as opened:
        assert opened.check() == []


@pytest.mark.long
def test_all_ranks_of_a_launcher_make_one_run_together_and_keep_it_once(launcher, tmp_path):
    scene = [*COARSE, "--set=horizon=1.0", "--json"]
    command = [*ENSEMBLE, "run", "doublet-shear", *scene]
    alone = json.loads(launcher.run(1, [*command, "--no-store"]).stdout)
    store = tmp_path / "store"
    together = launcher.run(3, [*command, f"--store={store}"])
    assert together.returncode == 0, together.stderr
    document = json.loads(together.stdout)
    assert document["run_key"] == alone["run_key"]
    assert document["gap"] == pytest.approx(alone["gap"], rel=1e-9)
    assert document["steps"] == alone["steps"]
    with Store.existing(store) as opened:
        (kept,) = opened.summaries()
        assert opened.check() == []
    again = launcher.run(2, [*command, f"--store={store}", "--ranks-per-run=1"])
    assert json.loads(again.stdout) == document
    assert kept.key == document["run_key"]


def test_a_killed_rank_of_a_group_ends_the_job(launcher, tmp_path):
    command = [*ENSEMBLE, "bisect", "--ranks-per-run=2", f"--store={tmp_path / 'store'}"]
    launched = launcher.start(2, command)
    family = []
    try:
        ranks: dict[int, psutil.Process] = {}
        while len(ranks) < 2 or not (tmp_path / "store").exists():
            assert launched.poll() is None
            time.sleep(0.05)
            ranks = ranks_of(launched)
        time.sleep(2.0)
        family = psutil.Process(launched.pid).children(recursive=True)
        ranks[1].send_signal(signal.SIGKILL)
        _, alive = psutil.wait_procs(family, timeout=SECONDS_TO_END)
        assert not alive
        assert launched.wait(SECONDS_TO_END) != 0
    finally:
        for process in family:
            if process.is_running():
                process.kill()
        launched.kill()
        launched.wait()


RUNNING = """
import sys
from pathlib import Path
import ensemble.mpi.checkpointed_run
from ensemble.search.task_queue import Task
from ensemble.config.run_key import run_key
from ensemble.mpi.world import abort_guard, world
from ensemble.mpi.run_study import run_queue
from ensemble.mpi.store_on_ranks import store_on_ranks
from ensemble.config.documents import load_scene

COARSE = ("numerics.points=32", "criteria.steady_time=1e9")
LONG, SHORT = (
    load_scene("vesicle-shear", [*COARSE, f"horizon={horizon}", "output.interval=10"])
    for horizon in (1e6, 2.0)
)

class MadeUpQueue:
    known_answers = runs_left = cancellations = 0

    def __init__(self):
        self.tasks = [Task(scene=scene, key=run_key(scene)) for scene in (SHORT, LONG)]
        self.long, self.answered = self.tasks[1], False

    def next_task(self):
        return self.tasks.pop() if self.tasks else None

    def answer(self, task, outcome):
        assert task.scene == SHORT
        self.answered = True

    def cancelled(self, task):
        assert task.scene == LONG
        self.cancellations += 1

    def unneeded_tasks(self):
        return (self.long,) if self.answered and not self.cancellations else ()

    @property
    def done(self):
        return self.answered and self.cancellations == 1

def broken(*_, **__):
    raise ValueError("this rank broke")

communicator, path = world(), Path(sys.argv[1])
if communicator.Get_rank() == int(sys.argv[2]):
    ensemble.mpi.checkpointed_run.checkpointed_run = broken
with abort_guard(communicator):
    with store_on_ranks(communicator, path) as store:
        queue, usage = run_queue(communicator, 2, store, MadeUpQueue, lambda *_: None, lambda queue: queue)
    print(f"runs {usage.runs}, cancelled {queue.cancellations};", end=" ")
"""


def test_a_cancellation_reaches_every_rank_of_the_group(launcher, tmp_path):
    result = launcher.run(4, [sys.executable, "-c", RUNNING, str(tmp_path / "store"), "-1"])
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("runs 1, cancelled 1;") == 4
    with Store.existing(tmp_path / "store") as opened:
        assert len(opened.summaries()) == 1


@pytest.mark.parametrize("rank", [2, 3])
def test_an_exception_on_one_rank_of_a_group_ends_the_job(launcher, tmp_path, rank):
    result = launcher.run(4, [sys.executable, "-c", RUNNING, str(tmp_path / "store"), str(rank)])
    assert result.returncode != 0
    assert "this rank broke" in result.stderr
