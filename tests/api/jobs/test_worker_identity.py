"""Names of workers: the dead are told from the living, and from those of other machines."""

from __future__ import annotations

import subprocess
import sys
import time

from api.jobs.worker_identity import has_died, own_identity
from tests.api.processes import run_python

NAMING = "from api.jobs.worker_identity import own_identity; print(own_identity(), flush=True)"
WAITING = f"{NAMING}; input()"


def test_a_worker_that_runs_has_not_died():
    assert not has_died(own_identity())


def test_a_worker_has_died_as_soon_as_it_is_killed():
    command = [sys.executable, "-c", WAITING]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as worker:
        name = worker.stdout.readline().strip()
        assert not has_died(name)
        worker.kill()
        deadline = time.monotonic() + 5
        while not has_died(name):  # before anybody has waited for it
            assert time.monotonic() < deadline
    assert has_died(name)


def test_another_process_of_the_same_number_is_another_one():
    place, number, started = own_identity().split(" ")
    assert has_died(f"{place} {number} {int(started) - 1}")


def test_nothing_is_said_of_other_machines():
    name = run_python(NAMING).stdout.strip()
    assert has_died(name)
    assert not has_died("elsewhere" + name)
    assert not has_died("a name of another kind")
