"""Makes the runs of a task queue on all groups of ranks.

Every rank simulates, together with the others of its group.  Rank 0 also runs the dispatcher, in a thread
beside its own simulations: it alone decides what is run next and alone writes to the database, so ranks
never contend for either.  All leaders of groups, rank 0 and one that is alone included, talk to it by the
same messages, and pass orders on to their group.

A blocking receive would spin and take the core from the simulation, so both sides poll with short sleeps.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, cast

from ensemble.mpi.groups import Groups
from ensemble.mpi.usage import RunUsage, Usage
from ensemble.mpi.world import abort_guard
from ensemble.search.task_queue import SomeTask, Task, TaskQueue

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from ensemble.mpi.store_on_ranks import StoreOnRank
    from ensemble.store import Staged, Store
    from solver.analysis.run import Outcome

_ORDERS = 1  # tag of messages to workers
_REPORTS = 2  # tag of messages to the dispatcher
_POLL_SECONDS = 0.002
_CANCEL_CHECK_SECONDS = 0.02


@dataclass(frozen=True)
class Cancel:
    """Order: stop the run of this key, if it is still going on."""

    key: str


@dataclass(frozen=True)
class Stop:
    """Order: there will be no further task."""


@dataclass(frozen=True)
class Ready:
    """Report: this group waits for its first task."""


@dataclass(frozen=True)
class Finished:
    """Report: the run is staged; simulating it took `seconds`."""

    staged: Staged
    outcome: Outcome
    seconds: float


@dataclass(frozen=True)
class Stopped:
    """Report: the run was cancelled after `seconds`."""

    seconds: float


Order = Task | Cancel | Stop
Report = Ready | Finished | Stopped


@dataclass(frozen=True)
class JobProgress(Generic[SomeTask]):
    """How far a task queue has come."""

    running: Mapping[int, SomeTask]  # by the rank of the group's leader among all leaders
    runs: int  # finished so far, without those that the store already had
    known: int  # answers that the store already had
    elapsed: float  # seconds
    seconds_left: float | None  # estimate, None before the first run is finished


def work(groups: Groups, store: StoreOnRank) -> None:
    """Simulate what the dispatcher orders until it says stop; all ranks do."""
    with abort_guard(groups.everyone):
        if groups.leaders is None:
            _follow(groups)
        else:
            _lead(groups, groups.leaders, store)


def _lead(groups: Groups, leaders: Intracomm, store: StoreOnRank) -> None:
    _send(leaders, Ready(), 0, _REPORTS)
    while True:
        order = _wait(leaders)
        # A cancellation that crossed the report of the run it names has nothing left to stop.
        if isinstance(order, Cancel):
            continue
        for follower in groups.followers:
            _send(groups.group, order, follower, _ORDERS)
        if isinstance(order, Stop):
            return
        _send(leaders, _simulate(groups, leaders, store, order), 0, _REPORTS)


def _follow(groups: Groups) -> None:
    from solver.simulation.simulate import Cancelled, simulate

    while isinstance(order := _wait(groups.group), Task):
        with suppress(Cancelled):
            simulate(order.scene, parallel=groups.parallel)


def _wait(communicator: Intracomm) -> Order:
    while (received := _receive(communicator, _ORDERS)) is None:
        time.sleep(_POLL_SECONDS)
    return cast(Order, received[0])


def _simulate(groups: Groups, leaders: Intracomm, store: StoreOnRank, task: Task) -> Report:
    # A study whose answers are all in the store never needs the compiled kernels.
    from solver.simulation.simulate import Cancelled, simulate

    begin = time.perf_counter()
    try:
        run = simulate(task.scene, parallel=groups.parallel, should_stop=_Cancellation(leaders, task.key))
    except Cancelled:
        return Stopped(time.perf_counter() - begin)
    seconds = time.perf_counter() - begin
    return Finished(store.stage(run), run.outcome, seconds)


class _Cancellation:
    """Whether the run of this key has been cancelled; asks MPI only every few steps."""

    def __init__(self, communicator: Intracomm, key: str) -> None:
        self._communicator = communicator
        self._key = key
        self._next_check = 0.0

    def __call__(self) -> bool:
        if time.monotonic() < self._next_check:
            return False
        self._next_check = time.monotonic() + _CANCEL_CHECK_SECONDS
        # While a run goes on, the only orders are cancellations; one may be late and name an earlier run.
        while (received := _receive(self._communicator, _ORDERS)) is not None:
            if received[0] == Cancel(self._key):
                return True
        return False


class Dispatcher(Generic[SomeTask]):
    """Answers reports with orders until the queue needs no further run.

    Parameters
    ----------
    communicator : Intracomm
        The leaders of all groups, all ranks of which `work` meanwhile.
    queue : TaskQueue
    store : Store
    on_change : callable
        Called whenever an outcome or an assignment changed something.
    usage : Usage
        Takes down what the groups do.
    """

    def __init__(
        self,
        communicator: Intracomm,
        queue: TaskQueue[SomeTask],
        store: Store,
        on_change: Callable[[JobProgress[SomeTask]], None],
        usage: Usage,
    ) -> None:
        self._communicator = communicator
        self._queue = queue
        self._store = store
        self._on_change = on_change
        self._usage = usage
        self._running: dict[int, SomeTask] = {}
        self._idle: set[int] = set()
        self._cancelled: set[str] = set()
        self._runs = 0

    def run(self) -> RunUsage:
        """Dispatch from the first report to the last order."""
        while len(self._idle) < self._communicator.Get_size() or not self._queue.done:
            report, rank = self._wait()
            self._take(report, rank)
            self._cancel_pointless()
            self._assign()
            self._on_change(self._progress())
        for rank in self._idle:
            _send(self._communicator, Stop(), rank, _ORDERS)
        return RunUsage(self._runs, self._usage.elapsed, self._usage.fractions())

    def _wait(self) -> tuple[Report, int]:
        while (received := _receive(self._communicator, _REPORTS)) is None:
            time.sleep(_POLL_SECONDS)
        return cast(tuple[Report, int], received)

    def _take(self, report: Report, rank: int) -> None:
        match report:
            case Finished(staged, outcome, seconds):
                task = self._running.pop(rank)
                self._store.commit(staged)
                self._queue.answer(task, outcome)
                self._runs += 1
                self._usage.ran(rank, seconds)
            case Stopped(seconds):
                self._queue.cancelled(self._running.pop(rank))
                self._usage.ran(rank, seconds)
        self._idle.add(rank)

    def _cancel_pointless(self) -> None:
        pointless = {task.key for task in self._queue.pointless_tasks()}
        for rank, task in self._running.items():
            if task.key in pointless - self._cancelled:
                _send(self._communicator, Cancel(task.key), rank, _ORDERS)
                self._cancelled.add(task.key)

    def _assign(self) -> None:
        for rank in sorted(self._idle):
            task = self._queue.next_task()
            if task is None:
                break
            self._cancelled.discard(task.key)
            self._running[rank] = task
            self._idle.remove(rank)
            _send(self._communicator, task, rank, _ORDERS)
        self._usage.idle(len(self._idle))

    def _progress(self) -> JobProgress[SomeTask]:
        return JobProgress(
            running=dict(self._running),
            runs=self._runs,
            known=self._queue.known_answers,
            elapsed=self._usage.elapsed,
            seconds_left=self._seconds_left(),
        )

    def _seconds_left(self) -> float | None:
        if self._usage.mean_run is None:
            return None
        return self._usage.mean_run * self._queue.runs_left / self._communicator.Get_size()


def _send(communicator: Intracomm, message: Order | Report, rank: int, tag: int) -> None:
    communicator.send(message, dest=rank, tag=tag)


def _receive(communicator: Intracomm, tag: int) -> tuple[Any, int] | None:
    """Take a message of this tag and its sender, if one has come."""
    from mpi4py import MPI

    status = MPI.Status()
    message = communicator.improbe(source=MPI.ANY_SOURCE, tag=tag, status=status)
    return None if message is None else (message.recv(), status.Get_source())
