"""Within `simulate` BLAS has one thread, for those who call it from Python, too."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
SCRIPT = """
import json
from solver import Scene, simulate
from threadpoolctl import threadpool_info

def threads():
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]

within = []
scene = Scene(horizon=0.02, vesicles=[{}], numerics={"points": 16})
simulate(scene, after_step=lambda _: within.append(threads()))
print(json.dumps({"within": within[0], "after": threads()}))
"""


def measured(**environment: str) -> dict[str, list[int]]:
    """Threads of each BLAS library during a simulation and after it, in a process of its own."""
    inherited = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        cwd=ROOT,
        env=inherited | environment,
        capture_output=True,
        text=True,
        timeout=200,
        check=True,
    )
    threads: dict[str, list[int]] = json.loads(done.stdout)
    return threads


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="BLAS starts with one thread on one processor")
def test_one_thread_while_it_lasts() -> None:
    threads = measured()
    assert set(threads["within"]) == {1}
    assert min(threads["after"]) > 1


def test_a_number_that_the_environment_states_stays() -> None:
    assert set(measured(OPENBLAS_NUM_THREADS="2")["within"]) == {2}
