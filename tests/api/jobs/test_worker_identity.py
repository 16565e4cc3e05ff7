"""Identities of workers: which have died, as far as this machine can know."""

from __future__ import annotations

import subprocess
import sys
import time

from api.jobs.worker_identity import has_died, own_identity
from tests.api.processes import run_python

PRINTING = "from api.jobs.worker_identity import own_identity; print(own_identity(), flush=True)"
WAITING = f"{PRINTING}; input()"


def test_a_worker_that_runs_has_not_died():
    assert not has_died(own_identity())


def test_a_worker_has_died_as_soon_as_it_is_killed():
    command = [sys.executable, "-c", WAITING]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as worker:
        identity = worker.stdout.readline().strip()
        assert not has_died(identity)
        worker.kill()
        deadline = time.monotonic() + 5
        while not has_died(identity):  # also while it is not reaped
            assert time.monotonic() < deadline
    assert has_died(identity)


def test_another_process_of_the_same_number_is_another_one():
    place, number, started = own_identity().split(" ")
    assert has_died(f"{place} {number} {int(started) - 1}")


def test_nothing_is_known_of_other_machines():
    identity = run_python(PRINTING).stdout.strip()
    assert has_died(identity)
    assert not has_died("elsewhere" + identity)
    assert not has_died("an identity of another kind")
