"""Traces a study, or runs a batch of scenes, on all ranks of a communicator, in groups."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from ensemble.errors import SUSPENDED_STATUS, Interrupted
from ensemble.mpi.dispatcher import Dispatcher, JobProgress, work
from ensemble.mpi.end_requests import EndRequests
from ensemble.mpi.groups import Groups
from ensemble.mpi.store_on_ranks import whole_store
from ensemble.mpi.usage import RunUsage, UsageMeter
from ensemble.mpi.world import abort_guard
from ensemble.search.batch import Batch
from ensemble.search.point_search import SearchRun
from ensemble.search.study_planner import StudyPlanner
from ensemble.search.task_queue import Task, TaskQueue
from ensemble.store.listing import ParameterRange

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from ensemble.config.study import Study
    from ensemble.mpi.store_on_ranks import StoreOnRank
    from ensemble.search.boundary import Boundary
    from solver.scene import Scene

Result = TypeVar("Result")


@dataclass(frozen=True)
class Snapshot:
    """How far a study has come.

    Attributes
    ----------
    boundary : Boundary
        As far as it is known.
    progress : JobProgress
        Of the runs.
    """

    boundary: Boundary
    progress: JobProgress[SearchRun]


@dataclass(frozen=True)
class StudyResult:
    """The boundary of a study, and what it took to trace it.

    Attributes
    ----------
    boundary : Boundary
        With the final status of every point.
    usage : RunUsage
        Of the ranks.
    """

    boundary: Boundary
    usage: RunUsage


def run_study(
    communicator: Intracomm,
    study: Study,
    store: StoreOnRank,
    on_change: Callable[[Snapshot], None],
    ranks_per_run: int = 1,
) -> StudyResult:
    """Trace the boundary of a study, making the runs that the store does not have.

    Collective.

    Parameters
    ----------
    communicator : Intracomm
        Its MPI library must provide MPI_THREAD_MULTIPLE.  Any exception on any rank aborts it.
    study : Study
        The same on every rank.
    store : Store or RunStaging
        From `store_on_ranks`; rank 0 commits.
    on_change : callable
        Called on rank 0, in the dispatcher's thread, at most twice a second and at the end.
    ranks_per_run : int
        How many ranks compute a run together.

    Returns
    -------
    StudyResult
        On every rank.
    """

    def begin() -> StudyPlanner:
        kept = whole_store(store)
        swept = (
            ParameterRange(sweep.parameter, min(sweep.values), max(sweep.values)) for sweep in study.sweep
        )
        searched = ParameterRange(study.search.parameter, *study.search.limits)
        made = kept.parameters_within(*swept, searched)
        return StudyPlanner(study, kept.answer, ((tuple(at), value) for *at, value in made))

    def publish(planner: StudyPlanner, progress: JobProgress[SearchRun]) -> None:
        boundary = planner.boundary()
        whole_store(store).save_boundary(boundary)
        on_change(Snapshot(boundary, progress))

    def conclude(planner: StudyPlanner) -> Boundary:
        boundary = planner.boundary()
        whole_store(store).save_boundary_arrays(boundary)
        return boundary

    boundary, usage = run_queue(communicator, ranks_per_run, store, begin, publish, conclude)
    return StudyResult(boundary, usage)


def run_batch(
    communicator: Intracomm,
    scenes: Iterable[Scene],
    store: StoreOnRank,
    on_change: Callable[[JobProgress[Task]], None],
    ranks_per_run: int = 1,
) -> RunUsage:
    """Run independent scenes, as far as the store does not have their runs.

    Collective.  A run that fails numerically is made and kept like any other.

    Parameters
    ----------
    communicator : Intracomm
        Its MPI library must provide MPI_THREAD_MULTIPLE.  Any exception on any rank aborts it.
    scenes : iterable of Scene
        What is run; it is read on rank 0.
    store : Store or RunStaging
        From `store_on_ranks`; rank 0 commits.
    on_change : callable
        Called on rank 0, in the dispatcher's thread, at most twice a second and at the end.
    ranks_per_run : int
        How many ranks compute a run together.

    Returns
    -------
    RunUsage
        On every rank.
    """
    _, usage = run_queue(
        communicator,
        ranks_per_run,
        store,
        begin=lambda: Batch(scenes, whole_store(store).answer),
        publish=lambda batch, progress: on_change(progress),
        conclude=lambda batch: None,
    )
    return usage


SomeTaskQueue = TypeVar("SomeTaskQueue", bound=TaskQueue)


def run_queue(
    communicator: Intracomm,
    ranks_per_run: int,
    store: StoreOnRank,
    begin: Callable[[], SomeTaskQueue],
    publish: Callable[[SomeTaskQueue, JobProgress], None],
    conclude: Callable[[SomeTaskQueue], Result],
) -> tuple[Result, RunUsage]:
    """Make the runs of a task queue.

    Collective.

    Parameters
    ----------
    communicator : Intracomm
        Its MPI library must provide MPI_THREAD_MULTIPLE.  Any exception on any rank aborts it.
    ranks_per_run : int
        How many ranks compute a run together.
    store : Store or RunStaging
        From `store_on_ranks`; rank 0 commits.
    begin : callable
        Returns the queue; called on rank 0.
    publish : callable
        Called on rank 0, in the dispatcher's thread, with the queue and its progress, at most twice
        a second and at the end.
    conclude : callable
        Returns what is wanted of the queue once it is done; called on rank 0.  What it returns is pickled.

    Returns
    -------
    result : object
        What `conclude` returned, on every rank.
    usage : RunUsage
        On every rank.

    Raises
    ------
    Interrupted
        On every rank, if the job was asked to end before the queue was done.  What was run is kept.
    """
    groups = Groups.of(communicator, ranks_per_run)
    everyone, leaders = groups.everyone, groups.leaders
    requests = EndRequests(everyone)

    def dispatch(leaders: Intracomm) -> tuple[Result, RunUsage] | None:
        with abort_guard(everyone):
            meter = UsageMeter(leaders.Get_size(), time.perf_counter)
            queue = begin()
            dispatcher = Dispatcher(
                leaders, queue, whole_store(store), lambda progress: publish(queue, progress), meter, requests
            )
            try:
                usage = dispatcher.run()
            except SystemExit as error:  # by Rich, where nobody reads; it would end this thread alone
                raise BrokenPipeError("nobody reads how far it is") from error
            return None if usage is None else (conclude(queue), usage)

    result: tuple[Result, RunUsage] | None = None
    with requests:
        if leaders is not None and leaders.Get_rank() == 0:
            with ThreadPoolExecutor(1, "dispatcher") as thread:
                dispatching = thread.submit(dispatch, leaders)
                work(groups, store)
                result = dispatching.result()
        else:
            work(groups, store)
        result = everyone.bcast(result)
    groups.free()
    if result is None:
        raise Interrupted(SUSPENDED_STATUS)
    return result
