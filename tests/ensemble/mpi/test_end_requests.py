"""A request to end that comes with the last step of a run holds for what the command does next."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from ensemble.errors import SUSPENDED_STATUS
from ensemble.store import Store

BATCHES = """
import os, signal, sys, time
from pathlib import Path
from ensemble.errors import Interrupted
from ensemble.interrupts import end_with_one_line
end_with_one_line()
from ensemble.mpi.run_study import run_batch
from ensemble.mpi.store_on_ranks import store_on_ranks
from ensemble.mpi.world import abort_guard, world
from tests.ensemble.runs import shear_scene
communicator = world()
asked = communicator.allgather(os.getpid())[int(sys.argv[2])]
at_end = []

def ask(progress):
    if progress.runs == 1 and not at_end:
        at_end.append(progress)
        os.kill(asked, signal.SIGTERM)
        time.sleep(1.0)  # the signal arrives

try:
    with abort_guard(communicator), store_on_ranks(communicator, Path(sys.argv[1])) as store:
        run_batch(communicator, [shear_scene(1.0)], store, ask)
        done = ["first"]
        run_batch(communicator, [shear_scene(1.0)], store, lambda _: None)
        done.append("known")
        run_batch(communicator, [shear_scene(2.0)], store, lambda _: None)
        done.append("second")
except Interrupted as interrupted:
    if communicator.Get_rank() == 0:
        print(*done)
    sys.exit(interrupted.status)
"""

# The first rank stages a run, and will report it, while the order to keep that run is sent to it.
CROSSING = """
import os, signal, sys, time
from pathlib import Path
from ensemble.errors import Interrupted
from ensemble.interrupts import end_with_one_line
end_with_one_line()
from ensemble.mpi.run_study import run_batch
from ensemble.mpi.store_on_ranks import store_on_ranks
from ensemble.mpi.world import abort_guard, world
from tests.ensemble.runs import shear_scene
communicator = world()
try:
    with abort_guard(communicator), store_on_ranks(communicator, Path(sys.argv[1])) as store:
        stage = store.stage_recorded

        def stage_late(results, record):
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.5)  # the order is sent
            return stage(results, record)

        store.stage_recorded = stage_late
        run_batch(communicator, [shear_scene(1.0), shear_scene(2.0)], store, lambda _: None)
except Interrupted as interrupted:
    sys.exit(interrupted.status)
"""

STEADY = """
import os, signal, sys
from pathlib import Path
from ensemble.errors import Interrupted
from ensemble.interrupts import end_with_one_line
end_with_one_line()
from ensemble.mpi.end_requests import EndRequests
from ensemble.questions.branches import run_of
from ensemble.store import Store
from tests.ensemble.runs import shear_run
run = shear_run()
with Store.open(Path(sys.argv[1])) as store:
    store.save(run)
    with EndRequests(None):
        os.kill(os.getpid(), signal.SIGTERM)
    try:
        run_of(run.scene, store)
    except Interrupted as interrupted:
        sys.exit(interrupted.status)
"""


@pytest.mark.parametrize("asked", [0, 1])
def test_the_next_runs_of_a_command_are_not_made(launcher, tmp_path: Path, asked: int) -> None:
    command = [sys.executable, "-c", BATCHES, str(tmp_path / "store"), str(asked)]
    result = launcher.run(2, command)
    assert result.returncode == SUSPENDED_STATUS, result.stderr
    assert result.stdout.split() == ["first", "known"]
    assert result.stderr.count("ends after the next step") == 1


def test_an_order_and_the_report_that_it_crosses_do_not_wait_for_each_other(launcher, tmp_path: Path) -> None:
    result = launcher.run(1, [sys.executable, "-c", CROSSING, str(tmp_path / "store")])
    assert result.returncode == SUSPENDED_STATUS, result.stderr
    with Store.existing(tmp_path / "store") as store:
        assert len(list(store.summaries())) == 1


def test_a_search_that_starts_from_a_run_is_not_begun(tmp_path: Path) -> None:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    result = subprocess.run(
        [sys.executable, "-c", STEADY, str(tmp_path / "store")],
        env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == SUSPENDED_STATUS, result.stderr
    assert result.stderr.count("ends after the next step") == 1
