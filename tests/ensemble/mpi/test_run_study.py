"""Studies on real ranks: traced, killed and resumed."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import psutil
import pytest

from ensemble.store import Store
from tests.ensemble.mpi.launched_ranks import ranks_of

SECONDS_TO_DIE = 60  # far less on a machine that has nothing else to do


def points(document: dict[str, Any]) -> list[tuple[Any, Any, Any, Any]]:
    return [
        (point["parameters"], point["bracket"], point["outcomes"], point["status"])
        for point in document["boundary"]
    ]


# The first point of the quick study alone: its bracket does not depend on what else is searched for.
FIRST = "--set=sweep.values=[0.5]"


def made(store: Path) -> dict[str, str]:
    """Time of creation of every committed run."""
    with Store.existing(store) as opened:
        return {summary.key: summary.created.isoformat() for summary in opened.summaries()}


@pytest.mark.long
@pytest.mark.parametrize("ranks", [1, 3])
def test_any_number_of_ranks_finds_the_same_brackets(
    launcher, bisect_command, finished_study, tmp_path, ranks
):
    result = launcher.run(ranks, bisect_command(tmp_path / "store"))
    assert result.returncode == 0, result.stderr
    assert points(json.loads(result.stdout)) == points(finished_study.document)


def test_without_a_launcher_it_is_the_same_study(ensemble, bisect_command, finished_study, tmp_path):
    _, _, _, *arguments = bisect_command(tmp_path / "store")
    result = ensemble(*arguments, FIRST)
    assert result.returncode == 0, result.stderr
    assert points(json.loads(result.stdout)) == points(finished_study.document)[:1]


def test_both_ranks_simulate(finished_study):
    assert 0 < finished_study.document["busy_fraction"] <= 1
    assert "2 running" in finished_study.progress


def test_a_finished_study_runs_nothing(launcher, bisect_command, finished_study):
    before = made(finished_study.store)
    result = launcher.run(2, bisect_command(finished_study.store))
    document = json.loads(result.stdout)
    assert result.returncode == 0
    assert points(document) == points(finished_study.document)
    assert document["busy_fraction"] is None
    assert made(finished_study.store) == before


def helper_of(launched: subprocess.Popen[str]) -> psutil.Process:
    return ranks_of(launched)[0].parent()


VICTIMS = {
    "launcher": lambda launched: psutil.Process(launched.pid),
    "helper": helper_of,
    "rank 0": lambda launched: ranks_of(launched)[0],
    "rank 1": lambda launched: ranks_of(launched)[1],
}


# One in the first tier: the launcher, which ends nothing else by dying; ranks of a group: test_groups.
OTHERS = [pytest.param(name, marks=pytest.mark.long) for name in VICTIMS if name != "launcher"]


@pytest.mark.parametrize("victim", ["launcher", *OTHERS])
def test_a_killed_study_leaves_no_process_and_continues_to_the_same_brackets(
    launcher, bisect_command, finished_study, tmp_path, victim
):
    store = tmp_path / "store"
    command = [*bisect_command(store), FIRST]
    launched = launcher.start(2, command)
    family = []
    try:
        while not (store / "runs").is_dir() or len(list((store / "runs").iterdir())) < 2:
            assert launched.poll() is None
            time.sleep(0.02)
        time.sleep(random.Random(victim).uniform(0, 0.3))
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
    result = launcher.run(2, command)
    assert result.returncode == 0, result.stderr
    assert points(json.loads(result.stdout)) == points(finished_study.document)[:1]
    assert 0 < len(kept) < len(made(store)), "it was not killed in the middle"
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
    raise RuntimeError("the callback broke")

communicator = world()
with store_on_ranks(communicator, Path(sys.argv[1])) as store:
    run_study(communicator, load_study("critical-hamaker"), store, explode)
"""


def test_an_exception_in_the_dispatcher_ends_the_job(launcher, tmp_path):
    result = launcher.run(2, [sys.executable, "-c", EXPLODING, str(tmp_path / "store")])
    assert result.returncode == 1
    assert "the callback broke" in result.stderr
