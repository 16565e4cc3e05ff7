"""One run, made by as many ranks together as there are, unless the store has it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from ensemble.config.documents import load_scene
from ensemble.config.run_key import run_key
from ensemble.errors import refusing
from ensemble.mpi.groups import chosen_ranks, split
from ensemble.mpi.world import abort_guard, launched_size, on_root, world
from ensemble.store.run_record import RunSummary
from solver.scene import Scene

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from ensemble.store import Store
    from solver.parallel import Parallel

Progress = AbstractContextManager[Callable[[float, float], None]]


def single_run(
    name_or_path: str,
    changes: Iterable[str],
    store: Path | None,
    ranks_per_run: str | None,
    progress: Progress,
) -> RunSummary | None:
    """Make the run of a scene.

    Collective where a launcher has started several processes; alone, no MPI library is needed.

    Parameters
    ----------
    name_or_path : str
        Of a scene.
    changes : iterable of str
        As `ensemble.config.documents.load_scene` takes them.
    store : Path or None
        Directory of the store that keeps the run.
    ranks_per_run : str or None
        As `ensemble.mpi.groups.chosen_ranks` takes it; None: all ranks.
    progress : context manager
        Gives a function that is told the time reached and the latest time, on the first rank.

    Returns
    -------
    RunSummary
        On the first rank; None elsewhere.

    Raises
    ------
    BadInput
        On every rank, before any work starts.
    """
    with ExitStack() as stack:
        communicator = world() if launched_size() > 1 else None
        size = 1
        if communicator is not None:
            stack.enter_context(abort_guard(communicator))
            size = communicator.Get_size()
        keep: Store | None = None

        def prepare() -> RunSummary | tuple[Scene, int]:
            nonlocal keep
            with refusing():
                scene = load_scene(name_or_path, changes)
                ranks = chosen_ranks(str(size) if ranks_per_run is None else ranks_per_run, scene, size)
                keep = None if store is None else stack.enter_context(_opened(store))
            if keep is not None and keep.contains(run_key(scene)):
                return keep.summary(run_key(scene))
            return scene, ranks

        prepared = on_root(communicator, prepare)
        first = communicator is None or communicator.Get_rank() == 0
        if isinstance(prepared, RunSummary):
            return prepared if first else None
        scene, ranks = prepared
        parallel = _together(communicator, ranks)
        if parallel is None:
            return None

        from solver.simulation.simulate import simulate

        run = simulate(scene, parallel=parallel, on_progress=stack.enter_context(progress) if first else None)
        if not first:
            return None
        if keep is not None:
            keep.save(run)
        return RunSummary.of(run)


def _together(communicator: Intracomm | None, ranks: int) -> Parallel | None:
    """The first ranks of a communicator, which compute the run; None on the others."""
    from ensemble.mpi.ranks import Ranks
    from solver.parallel import SERIAL

    if communicator is None:
        return SERIAL
    group = split(communicator, 0 if communicator.Get_rank() < ranks else None)
    if group is None:
        return None
    return Ranks(group) if ranks > 1 else SERIAL


def _opened(path: Path) -> Store:
    from ensemble.store import Store

    return Store.open(path)
