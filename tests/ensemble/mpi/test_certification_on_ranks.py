"""Certification on real ranks, of real simulations, through real kills."""

from __future__ import annotations

import json
import shutil
import signal
import time
from pathlib import Path
from typing import Any

import psutil
import pytest

from ensemble.store import Store

SECONDS_TO_DIE = 60  # far less on a machine that has nothing else to do


def runs_made(store: Path, points: int) -> dict[str, str]:
    """Time of creation of every committed run with this many points."""
    with Store.existing(store) as opened:
        found = opened.summaries([f"numerics.points={points}"])
    return {summary.key: summary.created.isoformat() for summary in found}


def certified_points(stdout: str) -> list[dict[str, Any]]:
    return [point | {"runs": None} for point in json.loads(stdout)["boundary"]]


def copied(finished: Path, store: Path) -> Path:
    """Copy a finished study without the runs that confirmed its ends: certification would take them over."""
    shutil.copytree(finished, store)
    with Store.open(store) as opened:
        for key in runs_made(store, points=48):
            opened.set_aside(key)
    return store


@pytest.fixture(scope="module")
def certified_store(launcher, bisect_command, finished_study, tmp_path_factory) -> tuple[Path, str]:
    """The finished study, certified afterwards: the store and standard output."""
    store = copied(finished_study.store, tmp_path_factory.mktemp("certified") / "store")
    result = launcher.run(2, [*bisect_command(store), "--certify"])
    assert result.returncode == 0, result.stderr
    return store, result.stdout


@pytest.mark.long
def test_a_finished_study_is_certified_by_new_runs_alone(finished_study, certified_store):
    store, stdout = certified_store
    assert runs_made(store, points=32) == runs_made(finished_study.store, points=32)
    certifying = runs_made(store, points=48)
    points = json.loads(stdout)["boundary"]
    assert len(certifying) >= 2 * len(points)
    for point, searched in zip(points, finished_study.document["boundary"], strict=True):
        assert point["status"] == "converged"
        assert point["certified"] is True
        assert (point["certified_by"]["points"], point["certified_by"]["tolerance"]) == (48, 1e-5)
        assert point["outcomes"] == ["separated", "bound"]
        assert point["bracket"][0] <= searched["bracket"][0] < searched["bracket"][1] <= point["bracket"][1]
        assert len(certifying.keys() & set(point["runs"])) >= 2


@pytest.mark.long
def test_a_certified_study_runs_nothing(launcher, bisect_command, certified_store):
    store, stdout = certified_store
    certifying = runs_made(store, points=48)
    again = launcher.run(2, [*bisect_command(store), "--certify"])
    assert again.returncode == 0, again.stderr
    assert certified_points(again.stdout) == certified_points(stdout)
    assert json.loads(again.stdout)["busy_fraction"] is None
    assert runs_made(store, points=48) == certifying


@pytest.mark.long
def test_killed_while_certifying_it_continues_to_the_same_certified_brackets(
    launcher, bisect_command, finished_study, certified_store, tmp_path
):
    store = copied(finished_study.store, tmp_path / "store")
    command = [*bisect_command(store), "--certify"]
    launched = launcher.start(2, command)
    family: list[psutil.Process] = []
    try:
        while not runs_made(store, points=48):
            assert launched.poll() is None
            time.sleep(0.02)
        family = psutil.Process(launched.pid).children(recursive=True)
        launched.send_signal(signal.SIGKILL)
        _, alive = psutil.wait_procs(family, timeout=SECONDS_TO_DIE)
        assert not alive
    finally:
        for process in family:
            if process.is_running():
                process.kill()
        launched.kill()
        launched.wait()

    kept, whole = runs_made(store, points=48), runs_made(certified_store[0], points=48)
    assert 0 < len(kept) < len(whole), "it was not killed in the middle"
    result = launcher.run(2, command)
    assert result.returncode == 0, result.stderr
    assert certified_points(result.stdout) == certified_points(certified_store[1])
    assert kept.items() <= runs_made(store, points=48).items(), "a committed run was made again"
    with Store.existing(store) as opened:
        assert opened.check() == []
