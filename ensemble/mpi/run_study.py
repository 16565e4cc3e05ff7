"""Traces a study, or runs a batch of scenes, on all ranks of a communicator, in groups."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar, cast

from ensemble.mpi.dispatcher import Dispatcher, JobProgress, work
from ensemble.mpi.groups import Groups
from ensemble.mpi.store_on_ranks import whole_store
from ensemble.mpi.usage import RunUsage, Usage
from ensemble.mpi.world import abort_guard
from ensemble.search.batch import Batch
from ensemble.search.point_search import SearchRun
from ensemble.search.study_planner import StudyPlanner
from ensemble.search.task_queue import Task, TaskQueue

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from ensemble.config.study import Study
    from ensemble.mpi.store_on_ranks import StoreOnRank
    from ensemble.search.boundary import Boundary
    from solver.scene import Scene

Result = TypeVar("Result")


@dataclass(frozen=True)
class Snapshot:
    """Where a study stands."""

    boundary: Boundary
    progress: JobProgress[SearchRun]


@dataclass(frozen=True)
class StudyResult:
    """A study's result, and what it cost."""

    boundary: Boundary
    cost: RunUsage


def run_study(
    communicator: Intracomm,
    study: Study,
    store: StoreOnRank,
    on_change: Callable[[Snapshot], None],
    ranks_per_run: int = 1,
) -> StudyResult:
    """Trace the boundary of a study, running what the store does not have.

    Collective.

    Parameters
    ----------
    communicator : Intracomm
        Its MPI library must provide MPI_THREAD_MULTIPLE.  Any exception on any rank aborts it.
    study : Study
    store : Store
        The same on every rank; rank 0 commits.
    on_change : callable
        Called on rank 0, in the coordinator's thread, whenever an answer or an assignment changed something.
    ranks_per_run : int
        How many ranks compute a run together.

    Returns
    -------
    Traced
        On every rank.
    """

    def begin() -> StudyPlanner:
        kept = whole_store(store)
        return StudyPlanner(study, kept.outcome, (summary.scene for summary in kept.summaries()))

    def publish(planner: StudyPlanner, progress: JobProgress[SearchRun]) -> None:
        boundary = planner.boundary()
        whole_store(store).save_boundary(boundary)
        on_change(Snapshot(boundary, progress))

    boundary, cost = carry_out(communicator, ranks_per_run, store, begin, publish, StudyPlanner.boundary)
    return StudyResult(boundary, cost)


def run_batch(
    communicator: Intracomm,
    scenes: Iterable[Scene],
    store: StoreOnRank,
    on_change: Callable[[JobProgress[Task]], None],
    ranks_per_run: int = 1,
) -> RunUsage:
    """Run independent scenes, as far as the store does not have their runs.

    Collective; parameters as for `run_study`.  A run that fails numerically is made and kept like any other.

    Returns
    -------
    Cost
        On every rank.
    """
    _, cost = carry_out(
        communicator,
        ranks_per_run,
        store,
        begin=lambda: Batch(scenes, whole_store(store).outcome),
        publish=lambda batch, progress: on_change(progress),
        conclude=lambda batch: None,
    )
    return cost


SomeTaskQueue = TypeVar("SomeTaskQueue", bound=TaskQueue)


def carry_out(
    communicator: Intracomm,
    ranks_per_run: int,
    store: StoreOnRank,
    begin: Callable[[], SomeTaskQueue],
    publish: Callable[[SomeTaskQueue, JobProgress], None],
    conclude: Callable[[SomeTaskQueue], Result],
) -> tuple[Result, RunUsage]:
    """Make the runs of a task queue; every rank gets what rank 0 concludes from it, and what it cost.

    Collective.

    Parameters
    ----------
    communicator, ranks_per_run, store
        As for `run_study`.
    begin : callable
        Returns the queue, on rank 0.
    publish : callable
        Called as ``on_change`` of `run_study` is, with the queue.
    conclude : callable
        Returns what is wanted of the queue once it is done; it is pickled.
    """
    groups = Groups.of(communicator, ranks_per_run)
    everyone, leaders = groups.everyone, groups.leaders

    def coordinate(leaders: Intracomm) -> tuple[Result, RunUsage]:
        with abort_guard(everyone):
            usage = Usage(leaders.Get_size(), time.perf_counter)
            queue = begin()
            dispatcher = Dispatcher(
                leaders, queue, whole_store(store), lambda progress: publish(queue, progress), usage
            )
            cost = dispatcher.run()
            return conclude(queue), cost

    result: tuple[Result, RunUsage] | None = None
    if leaders is not None and leaders.Get_rank() == 0:
        with ThreadPoolExecutor(1, "coordinator") as beside:
            coordination = beside.submit(coordinate, leaders)
            work(groups, store)
            result = coordination.result()
    else:
        work(groups, store)
    result = everyone.bcast(result)
    groups.free()
    return cast(tuple[Result, RunUsage], result)
