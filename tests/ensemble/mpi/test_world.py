"""The edge to MPI: what the launcher says, and jobs that end as a whole."""

from __future__ import annotations

import sys

import pytest

from ensemble.mpi.world import launched_rank, launched_size


@pytest.mark.parametrize(
    ("environment", "size", "rank"),
    [
        ({}, 1, 0),
        ({"PMI_SIZE": "4", "PMI_RANK": "3"}, 4, 3),
        ({"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_RANK": "1"}, 2, 1),
        ({"SLURM_STEP_NUM_TASKS": "8", "SLURM_PROCID": "5"}, 8, 5),
        # An mpirun inside a Slurm step of its own.
        ({"SLURM_STEP_NUM_TASKS": "1", "SLURM_PROCID": "0", "PMI_SIZE": "4", "PMI_RANK": "2"}, 4, 2),
        # A batch script that launches nothing: the allocation's size is not a launcher's.
        ({"SLURM_NTASKS": "8", "SLURM_PROCID": "0"}, 1, 0),
    ],
)
def test_the_launcher_is_read_from_its_environment(environment, size, rank):
    assert launched_size(environment) == size
    assert launched_rank(environment) == rank


FAILING = """
import sys, time
from ensemble.mpi.world import abort_guard, world
communicator = world()
with abort_guard(communicator):
    if communicator.Get_rank() == {rank}:
        raise {error}
    communicator.barrier()
"""


@pytest.mark.parametrize("error", ['ValueError("this rank broke")', "KeyboardInterrupt"])
@pytest.mark.parametrize("rank", [0, 1])
def test_an_exception_on_one_rank_ends_all(launcher, rank, error):
    result = launcher.run(2, [sys.executable, "-c", FAILING.format(rank=rank, error=error)])
    assert result.returncode == 1
    assert error.split("(")[0] in result.stderr
    assert "Traceback" in result.stderr


REFUSING = """
from ensemble.errors import BadInput
from ensemble.mpi.world import abort_guard, on_root, world

def refuse():
    raise BadInput("points: 7")

communicator = world()
caught = False
with abort_guard(communicator):
    try:
        on_root(communicator, refuse)
    except BadInput as error:
        caught = str(error) == "points: 7"
    value = on_root(communicator, communicator.Get_rank)
assert caught and value == 0
print("both")
"""


def test_what_rank_0_finds_wrong_is_raised_on_every_rank(launcher):
    result = launcher.run(2, [sys.executable, "-c", REFUSING])
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("both") == 2


THREADS = """
from ensemble.mpi.world import pin_threads
pin_threads()
import numba, numpy, scipy.linalg
from threadpoolctl import threadpool_info
print(max(pool["num_threads"] for pool in threadpool_info()), numba.get_num_threads())
"""


@pytest.mark.parametrize(("asked", "threads"), [(None, "1"), ("2", "2")])
def test_a_rank_has_one_thread_unless_asked(launcher, monkeypatch, asked, threads):
    variables = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
    for variable in variables:
        if asked is None:
            monkeypatch.delenv(variable, raising=False)
        else:
            monkeypatch.setenv(variable, asked)
    result = launcher.run(1, [sys.executable, "-c", THREADS])
    assert result.stdout.split() == [threads, threads], result.stderr
