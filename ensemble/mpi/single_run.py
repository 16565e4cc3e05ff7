"""One run, made by several ranks together, unless the store has it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from ensemble.config.run_key import run_key
from ensemble.errors import SUSPENDED_STATUS, Interrupted
from ensemble.mpi.end_requests import EndRequests
from ensemble.mpi.groups import split
from ensemble.mpi.store_on_ranks import whole_store
from ensemble.mpi.world import on_root
from solver.scene import Scene

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from ensemble.mpi.checkpointed_run import CheckpointKeeper
    from ensemble.mpi.store_on_ranks import StoreOnRank
    from ensemble.store.run_record import RunSummary
    from solver.analysis.record import Sink
    from solver.analysis.run import RunResults
    from solver.parallel import Parallel


def single_run(
    communicator: Intracomm | None,
    scene: Scene,
    store: StoreOnRank | None,
    ranks: int,
    on_progress: Callable[[float, float], None],
) -> RunSummary | None:
    """Make the run of a scene, unless the store has it.

    Collective.

    Parameters
    ----------
    communicator : Intracomm or None
        All ranks; None if this process is alone.
    scene : Scene
        The same on every rank.
    store : Store or RunStaging or None
        From `store_on_ranks`; None if no store keeps the run.
    ranks : int
        How many ranks compute the run together.
    on_progress : callable
        Called on the first rank with the time that is reached and the latest end.

    Returns
    -------
    RunSummary or None
        On the first rank; None elsewhere.

    Raises
    ------
    Interrupted
        On every rank, if the job was asked to end before the run was done; its checkpoint is kept.
    """

    def stored() -> RunSummary | None:
        if store is None:
            return None
        key, kept = run_key(scene), whole_store(store)
        return kept.summary(key) if kept.contains(key) else None

    is_first = communicator is None or communicator.Get_rank() == 0
    summary = on_root(communicator, stored)
    if summary is not None:
        return summary if is_first else None
    parallel = _first_ranks(communicator, ranks)

    from ensemble.store.run_record import RunSummary
    from solver.analysis.record import SERIES, VESICLE_SERIES, Forgetful

    nothing = Forgetful()
    if store is None:
        run = _made(scene, parallel, nothing, None, on_progress)
        if run is None or not is_first:
            return None
        return RunSummary.of_parts(run, nothing.names[SERIES], nothing.names.get(VESICLE_SERIES, ()))
    with EndRequests(communicator) as requests:
        keeper = _keeper(store, scene, requests) if is_first else None
        run = _made(scene, parallel, keeper.record if keeper else nothing, keeper, on_progress)
        if on_root(communicator, lambda: run is None):
            raise Interrupted(SUSPENDED_STATUS)
        if run is None or keeper is None:
            return None
        kept = whole_store(store)
        staged = kept.stage_recorded(run, keeper.record)
        kept.commit(staged)
        return staged.summary


def _keeper(store: StoreOnRank, scene: Scene, requests: EndRequests) -> CheckpointKeeper:
    from ensemble.mpi.checkpointed_run import CheckpointKeeper, Order

    return CheckpointKeeper(
        store.checkpoint(scene), lambda: Order.SUSPEND if requests.arrived else Order.GO_ON
    )


def _made(
    scene: Scene,
    parallel: Parallel | None,
    sink: Sink,
    keeper: CheckpointKeeper | None,
    on_progress: Callable[[float, float], None],
) -> RunResults | None:
    """Make a run on the ranks that have a part in it; None on the others, and if it was suspended."""
    from ensemble.mpi.checkpointed_run import Stopped, checkpointed_run

    if parallel is None:
        return None
    try:
        return checkpointed_run(scene, parallel, sink, keeper, on_progress if parallel.rank == 0 else None)
    except Stopped:
        return None


def _first_ranks(communicator: Intracomm | None, ranks: int) -> Parallel | None:
    """How the first ranks of a communicator compute a run together; None on the others."""
    from ensemble.mpi.ranks import Ranks
    from solver.parallel import SERIAL

    if communicator is None:
        return SERIAL
    group = split(communicator, 0 if communicator.Get_rank() < ranks else None)
    if group is None:
        return None
    return Ranks(group) if ranks > 1 else SERIAL
