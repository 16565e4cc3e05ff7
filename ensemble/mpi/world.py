"""Where MPI begins and ends: the communicator of all ranks, what the launcher says of it, and ending a job.

Only the command line calls `world`; everything else takes its communicator as an argument.  mpi4py is
imported when a communicator is requested, so commands that need none run where no MPI is installed.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout, suppress
from typing import TYPE_CHECKING, TypeVar

from ensemble.errors import BadInput, Interrupted, told_in_a_line

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

T = TypeVar("T")

# Variables by which launchers inform their processes, most specific first: an mpirun inside a Slurm step
# overrides the step.
_SIZE_VARIABLES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "MV2_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS")
_RANK_VARIABLES = ("PMI_RANK", "OMPI_COMM_WORLD_RANK", "MV2_COMM_WORLD_RANK", "SLURM_PROCID")

_THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

_FORWARD_SECONDS = 0.3
_MEETING_SECONDS = 20


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


def is_launched(environment: Mapping[str, str] = os.environ) -> bool:
    """Tell whether a launcher has started this process, be it the only one.

    Parameters
    ----------
    environment : mapping
        Environment variables.

    Returns
    -------
    bool
    """
    return any(variable in environment for variable in _RANK_VARIABLES)


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


def has_joined() -> bool:
    """Tell whether this process has joined the other ranks: its launcher then ends them with it."""
    module = sys.modules.get("mpi4py.MPI")
    is_initialized = getattr(module, "Is_initialized", None)  # not there yet while it is being imported
    return is_initialized is not None and bool(is_initialized())


def fail_with_others() -> None:
    """Let the other ranks know that this one fails before it has joined them; nothing happens later on.

    They would wait for it for ever: a launcher ignores what ends with a status before MPI has begun.  Ranks
    that all fail in the same way meet here.  If the others have ended already, a signal ends this process.
    """
    if launched_size() == 1 or has_joined():
        return
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(_MEETING_SECONDS)
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError):
        return
    _argument_lists(MPI.COMM_WORLD, could_start=False)
    signal.alarm(0)


def _require_same_arguments(communicator: Intracomm) -> None:
    """Refuse ranks that were started with different arguments: only the first rank's would count."""
    ranks = _argument_lists(communicator, could_start=True)
    first, _ = ranks[0]
    for rank, (other, could_start) in enumerate(ranks):
        if other != first:
            raise BadInput(
                f"arguments: rank {rank} has {' '.join(other)!r} and rank 0 {' '.join(first)!r}; "
                "all ranks of a job carry out one command, so start a job for each"
            )
        if not could_start:
            raise BadInput(f"rank {rank}: it could not start")


def _argument_lists(communicator: Intracomm, could_start: bool) -> list[tuple[list[str], bool]]:
    """Tell each rank the arguments of all, and which of them go on.  Collective."""
    told: list[tuple[list[str], bool]] = communicator.allgather((sys.argv[1:], could_start))
    return told


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


def tell(line: str) -> None:
    """Print a line to people, from any rank.

    Parameters
    ----------
    line : str
    """
    _teller[-1](f"ensemble: {line}")


@contextmanager
def telling(teller: Callable[[str], None]) -> Iterator[None]:
    """Let a function show what is told within the block.

    Parameters
    ----------
    teller : callable
        Takes a line; also within a signal handler.

    Yields
    ------
    None
    """
    _teller.append(teller)
    try:
        yield
    finally:
        _teller.pop()


def _print_to_process(line: str) -> None:
    # The stream of the process: the command line silences sys.stderr on every rank but the first.
    print(line, file=sys.__stderr__, flush=True)


_teller: list[Callable[[str], None]] = [_print_to_process]


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
    and leaves the block on every rank.  So does an interruption: either there is one rank, or the job was
    asked to end, and every rank raises it.

    Parameters
    ----------
    communicator : Intracomm or None
        All ranks; None if this process is alone, which then ends as it would without the block.
    """
    try:
        yield
    except (BadInput, SystemExit):
        raise
    except BaseException as error:
        if communicator is None or Interrupted.latest is not None:
            raise
        import traceback  # here, because signals are provided for only when this module has been imported

        line = told_in_a_line(error)
        with suppress(OSError, ValueError):  # what is told nobody may read any more: that may be the error
            if line is None:
                print(traceback.format_exc(), file=sys.__stderr__, flush=True)
            else:
                tell(line)
        # The launcher stops forwarding output as soon as it hears of the end.
        time.sleep(_FORWARD_SECONDS)
        communicator.Abort(1)
