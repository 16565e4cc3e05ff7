"""Where MPI begins and ends: the communicator of all ranks, what the launcher says of it, and ending a job.

Only the command line calls `world`; everything else takes its communicator as an argument.  mpi4py is
imported when a communicator is requested, so commands that need none run where no MPI is installed.
"""

from __future__ import annotations

import os
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from typing import TYPE_CHECKING, TypeVar

from ensemble.errors import BadInput, EnsembleError, Interrupted

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

T = TypeVar("T")

# Variables by which launchers inform their processes, most specific first: an mpirun inside a Slurm step
# overrides the step.
_SIZE_VARIABLES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "MV2_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS")
_RANK_VARIABLES = ("PMI_RANK", "OMPI_COMM_WORLD_RANK", "MV2_COMM_WORLD_RANK", "SLURM_PROCID")

_THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

_PARENT_CHECK_SECONDS = 0.5
_FORWARD_SECONDS = 0.3


def pin_threads() -> None:
    """Give BLAS and Numba one thread in this process, unless the environment already says otherwise.

    `simulate` limits BLAS by itself.  These variables, which the libraries read when they are loaded, spare
    each rank the threads that BLAS would start, one for each processor, and keep idle.  Child processes
    inherit them.  Call this before the first import of NumPy.
    """
    for variable in _THREAD_VARIABLES:
        os.environ.setdefault(variable, "1")


def launched_size(environment: Mapping[str, str] = os.environ) -> int:
    """Return the number of processes that the launcher says it has started.

    Parameters
    ----------
    environment : mapping
        Environment variables.

    Returns
    -------
    int
        1 without a launcher.
    """
    return _first_integer(environment, _SIZE_VARIABLES, 1)


def launched_rank(environment: Mapping[str, str] = os.environ) -> int:
    """Return the rank that the launcher has given this process.

    Parameters
    ----------
    environment : mapping
        Environment variables.

    Returns
    -------
    int
        0 without a launcher.
    """
    return _first_integer(environment, _RANK_VARIABLES, 0)


def _first_integer(environment: Mapping[str, str], variables: tuple[str, ...], default: int) -> int:
    for variable in variables:
        if variable in environment:
            return int(environment[variable])
    return default


def world() -> Intracomm:
    """Return the communicator of all launched processes, after checking it.

    Returns
    -------
    Intracomm
        All ranks.

    Raises
    ------
    BadInput
        If no MPI library can be loaded, if the launcher belongs to another MPI than the library (each
        process would then silently be a world of its own), if threads may not call MPI concurrently, or if
        the ranks were started with different arguments.
    """
    launched = launched_size()
    if launched > 1:
        _end_with_parent()
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError) as error:
        raise BadInput(f"no MPI library can be loaded (the extra 'mpich' brings one): {error}") from error
    if launched > 1 and MPI.COMM_WORLD.Get_size() == 1:
        raise BadInput(
            f"launcher: it started {launched} processes, but the MPI library sees only 1; "
            f"launch with the mpirun that belongs to {MPI.Get_library_version().splitlines()[0].strip()}"
        )
    if MPI.Query_thread() < MPI.THREAD_MULTIPLE:
        raise BadInput("MPI library: it must provide MPI_THREAD_MULTIPLE, and this one does not")
    _require_same_arguments(MPI.COMM_WORLD)
    return MPI.COMM_WORLD


def _require_same_arguments(communicator: Intracomm) -> None:
    """Refuse ranks that were started with different arguments: only the first rank's would count."""
    arguments = communicator.allgather(sys.argv[1:])
    for rank, other in enumerate(arguments):
        if other != arguments[0]:
            raise BadInput(
                f"arguments: rank {rank} has {' '.join(other)!r} and rank 0 {' '.join(arguments[0])!r}; "
                "all ranks of a job carry out one command, so start a job for each"
            )


def on_root(communicator: Intracomm | None, function: Callable[[], T]) -> T:
    """Call a function on rank 0, and return its result or raise its `BadInput` on every rank.

    Collective.

    Parameters
    ----------
    communicator : Intracomm or None
        All ranks; None if this process is alone.
    function : callable
        Its result is pickled.

    Returns
    -------
    object
        The result, on every rank.

    Raises
    ------
    BadInput
        On every rank, if the function raises it.
    """
    if communicator is None:
        return function()
    result: T | BadInput | None = None
    if communicator.Get_rank() == 0:
        try:
            result = function()
        except BadInput as error:
            result = error
    result = communicator.bcast(result)
    if isinstance(result, BadInput):
        raise result
    return result


@contextmanager
def only_first_rank_speaks() -> Iterator[None]:
    """Drop what this process prints within the block if its launcher has given it another rank than 0."""
    with ExitStack() as stack:
        if launched_rank() != 0:
            nowhere = stack.enter_context(open(os.devnull, "w"))
            stack.enter_context(redirect_stdout(nowhere))
            stack.enter_context(redirect_stderr(nowhere))
        yield


@contextmanager
def abort_guard(communicator: Intracomm | None) -> Iterator[None]:
    """End the whole job, with status 1, when an exception leaves the block on this rank.

    Otherwise the other ranks would wait for this one for ever.  `BadInput` passes: it comes from `on_root`
    and leaves the block on every rank.  So does `Interrupted`, which is raised only where there is one rank.

    Parameters
    ----------
    communicator : Intracomm or None
        All ranks; None if this process is alone, which then ends as it would without the block.
    """
    try:
        yield
    except (BadInput, SystemExit, Interrupted):
        raise
    except BaseException as error:
        if communicator is None:
            raise
        # What is wrong with the machine or the store is said in a line; anything else is an error of ours.
        expected = isinstance(error, EnsembleError | OSError)
        text = f"ensemble: {error}" if expected else traceback.format_exc()
        # The stream of the process: the command line silences sys.stderr on every rank but the first.
        print(text, file=sys.__stderr__, flush=True)
        # The launcher stops forwarding output as soon as it hears of the end.
        time.sleep(_FORWARD_SECONDS)
        communicator.Abort(1)


def _end_with_parent() -> None:
    """Let this process end when the process that started it does.

    An MPI launcher that is killed takes its ranks along, but its helper on each node does not: ranks that
    lost it would simulate on, unrecorded.  A new parent is the sign.
    """
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_PARENT_CHECK_SECONDS)
        os._exit(1)

    threading.Thread(target=watch, name="parent-watch", daemon=True).start()
