"""Makes the runs of a task queue on all groups of ranks.

Every rank simulates, together with the others of its group.  Rank 0 also runs the dispatcher, in a thread
beside its own simulations.  Only the dispatcher decides what is run next and only it writes to the database,
so ranks never contend for either.  The leaders of all groups exchange the same messages with it, rank 0 and
the leader of a group of one included, and pass orders on to their group.

A blocking receive would spin and take the core from the simulation, so both sides poll with short sleeps.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import TYPE_CHECKING, Any, Generic, Protocol, cast

from ensemble.mpi.groups import Groups
from ensemble.mpi.usage import RunUsage, UsageMeter
from ensemble.mpi.world import abort_guard
from ensemble.search.task_queue import RunAnswer, SomeTask, Task, TaskQueue

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm, Request

    from ensemble.mpi.end_requests import EndRequests
    from ensemble.mpi.store_on_ranks import StoreOnRank
    from ensemble.store import Staged, Store

_ORDERS = 1  # tag of messages to workers
_REPORTS = 2  # tag of messages to the dispatcher
_POLL_SECONDS = 0.002
_PUBLISH_SECONDS = 0.5
_PUBLISH_SHARE = 0.005  # of this thread's time that it takes at most; a boundary may have a thousand points


@dataclass(frozen=True)
class Cancel:
    """Order: stop a run, if it is still going on.

    Attributes
    ----------
    key : str
        Of the run.
    """

    key: str


@dataclass(frozen=True)
class Suspend:
    """Order: keep the run that is going on, if there is one, and stop it."""


@dataclass(frozen=True)
class Stop:
    """Order: there will be no further task."""


@dataclass(frozen=True)
class Ready:
    """Report: this group waits for its first task."""


@dataclass(frozen=True)
class Finished:
    """Report: a run is finished and staged.

    Attributes
    ----------
    staged : Staged
        To be committed by the dispatcher.
    answer : RunAnswer
        Of the run.
    seconds : float
        That it took to simulate.
    """

    staged: Staged
    answer: RunAnswer
    seconds: float


@dataclass(frozen=True)
class Unfinished:
    """Report: a run was cancelled or suspended.

    Attributes
    ----------
    seconds : float
        After which it was.
    """

    seconds: float


DispatcherOrder = Task | Cancel | Suspend | Stop
WorkerReport = Ready | Finished | Unfinished


@dataclass(frozen=True)
class JobProgress(Generic[SomeTask]):
    """How far a task queue has come.

    Attributes
    ----------
    running : mapping from int to Task
        Tasks that are being carried out, by the rank of the group's leader among all leaders.
    runs : int
        How many runs have been made, without those that the store had already.
    known : int
        How many answers the store had already.
    elapsed : float
        Seconds since the start.
    seconds_left : float or None
        An estimate; None before a group has finished its second run.
    """

    running: Mapping[int, SomeTask]
    runs: int
    known: int
    elapsed: float
    seconds_left: float | None


def work(groups: Groups, store: StoreOnRank) -> None:
    """Simulate what the dispatcher orders until it says stop.

    Collective.

    Parameters
    ----------
    groups : Groups
        This rank's view of them.
    store : Store or RunStaging
        Where finished runs are staged.
    """
    with abort_guard(groups.everyone):
        if groups.leaders is None:
            _follow(groups)
        else:
            _lead(groups, groups.leaders, store)


def _lead(groups: Groups, leaders: Intracomm, store: StoreOnRank) -> None:
    _send(leaders, Ready(), 0, _REPORTS)
    first = True
    while True:
        order = _wait(leaders)
        # An order that crossed the report of the run that it means has nothing left to stop.
        if isinstance(order, Cancel | Suspend):
            continue
        for follower in groups.followers:
            _send(groups.group, order, follower, _ORDERS)
        if isinstance(order, Stop):
            return
        _send(leaders, _simulate(groups, leaders, store, order, first), 0, _REPORTS)
        first = False


def _follow(groups: Groups) -> None:
    from ensemble.mpi.checkpointed_run import Stopped, checkpointed_run
    from solver.analysis.record import Forgetful

    while isinstance(order := _wait(groups.group), Task):
        with suppress(Stopped):
            checkpointed_run(order.scene, groups.parallel, Forgetful(), None)


def _wait(communicator: Intracomm) -> DispatcherOrder:
    while (received := _receive(communicator, _ORDERS)) is None:
        time.sleep(_POLL_SECONDS)
    return cast(DispatcherOrder, received[0])


def _simulate(
    groups: Groups, leaders: Intracomm, store: StoreOnRank, task: Task, first: bool
) -> WorkerReport:
    # A study whose answers are all in the store never needs the compiled kernels.
    from ensemble.mpi.checkpointed_run import CheckpointKeeper, Order, Stopped, checkpointed_run
    from solver.simulation.preparation import compile_for

    def order() -> Order:
        # While a run goes on nobody orders another one; a cancellation may be late and name an earlier run.
        while (received := _receive(leaders, _ORDERS)) is not None:
            if received[0] == Cancel(task.key):
                return Order.CANCEL
            if received[0] == Suspend():
                return Order.SUSPEND
        return Order.GO_ON

    begin = time.perf_counter()
    if first and leaders.size > 1:
        compile_for(task.scene, leaders.rank)
    keeper = CheckpointKeeper(store.checkpoint(task.scene), order)
    try:
        run = checkpointed_run(task.scene, groups.parallel, keeper.record, keeper)
    except Stopped:
        return Unfinished(time.perf_counter() - begin)
    seconds = time.perf_counter() - begin
    answer = RunAnswer(run.outcome, run.sensitive, run.configuration)
    return Finished(store.stage_recorded(run, keeper.record), answer, seconds)


class Clock(Protocol):
    """What the dispatcher knows of time; see the module `time`."""

    def monotonic(self) -> float:
        """Return the time, in seconds."""

    def thread_time(self) -> float:
        """Return for how long the processor has worked for this thread."""

    def sleep(self, seconds: float, /) -> None:
        """Wait.

        Parameters
        ----------
        seconds : float
        """


class Dispatcher(Generic[SomeTask]):
    """Answers reports with orders until the queue needs no further run.

    Parameters
    ----------
    communicator : Intracomm
        The leaders of all groups; all ranks of these groups `work` meanwhile.
    queue : TaskQueue
        Decides what is run.
    store : Store
        Where runs are committed.
    on_change : callable
        Called with the progress when outcomes or assignments have changed something, at most twice a second
        and for a two-hundredth of the time, and at the end.
    meter : UsageMeter
        Measures what the groups do.
    requests : EndRequests
        Whether the job is asked to end.
    clock : Clock
        By which it waits, and measures its own work.
    """

    def __init__(
        self,
        communicator: Intracomm,
        queue: TaskQueue[SomeTask],
        store: Store,
        on_change: Callable[[JobProgress[SomeTask]], None],
        meter: UsageMeter,
        requests: EndRequests,
        clock: Clock = time,
    ) -> None:
        self._clock = clock
        self._communicator = communicator
        self._queue = queue
        self._store = store
        self._on_change = on_change
        self._meter = meter
        self._requests = requests
        self._running: dict[int, SomeTask] = {}
        self._rank_of: dict[str, int] = {}  # of a task that is running, by its key
        self._idle: list[int] = []  # a heap
        self._cancelled: set[str] = set()
        self._sent: list[Request] = []  # orders that a rank may not have taken yet
        self._runs = 0
        self._changed = False
        self._ends = False
        self._next_publication = -math.inf

    def run(self) -> RunUsage | None:
        """Dispatch from the first report to the last order.

        Returns
        -------
        RunUsage or None
            What it took; None if the job was asked to end, and runs are left to be made.
        """
        while len(self._idle) < self._communicator.Get_size() or not (self._queue.done or self._ends):
            reports = list(self._reports())
            if staged := [report.staged for report, _ in reports if isinstance(report, Finished)]:
                self._store.commit_all(staged)
            for report, rank in reports:
                self._take(report, rank)
            self._suspend_if_asked()
            self._cancel_unneeded()
            self._assign()
            self._changed = True
            self._publish_if_due()
        self._publish()
        for rank in self._idle:
            self._order(Stop(), rank)
        for order in self._sent:
            order.wait()
        if not self._queue.done:
            return None
        return RunUsage(self._runs, self._meter.elapsed, self._meter.fractions())

    def _reports(self) -> Iterator[tuple[WorkerReport, int]]:
        """Wait for a report; yield it and all others that have come."""
        while (received := _receive(self._communicator, _REPORTS)) is None:
            self._suspend_if_asked()
            self._publish_if_due()
            self._clock.sleep(_POLL_SECONDS)
        # Not more than one of each group: while reports keep coming the groups must get orders, too.
        for _ in range(self._communicator.Get_size()):
            yield cast(tuple[WorkerReport, int], received)
            if (received := _receive(self._communicator, _REPORTS)) is None:
                return
        yield cast(tuple[WorkerReport, int], received)

    def _suspend_if_asked(self) -> None:
        if not self._ends and self._requests.arrived:
            self._ends = True
            for rank in self._running:
                self._order(Suspend(), rank)

    def _publish_if_due(self) -> None:
        if self._changed and self._clock.monotonic() >= self._next_publication:
            self._publish()

    def _publish(self) -> None:
        self._changed = False
        begin = self._clock.thread_time()
        self._on_change(self._progress())
        worked = self._clock.thread_time() - begin
        pause = max(_PUBLISH_SECONDS, worked / _PUBLISH_SHARE)
        self._next_publication = self._clock.monotonic() + pause

    def _take(self, report: WorkerReport, rank: int) -> None:
        match report:
            case Finished(_, answer, seconds):
                task = self._end(rank)
                self._queue.answer(task, answer)
                self._runs += 1
                self._meter.record_run(rank, seconds)
            case Unfinished(seconds):
                self._queue.cancelled(self._end(rank))
                self._meter.record_run(rank, seconds)
        heappush(self._idle, rank)

    def _end(self, rank: int) -> SomeTask:
        task = self._running.pop(rank)
        del self._rank_of[task.key]
        return task

    def _cancel_unneeded(self) -> None:
        for task in self._queue.unneeded_tasks():
            rank = self._rank_of.get(task.key)
            if rank is not None and task.key not in self._cancelled:
                self._order(Cancel(task.key), rank)
                self._cancelled.add(task.key)

    def _assign(self) -> None:
        while self._idle and not self._ends and (task := self._queue.next_task()) is not None:
            rank = heappop(self._idle)
            self._cancelled.discard(task.key)
            self._running[rank] = task
            self._rank_of[task.key] = rank
            self._order(task, rank)
        self._meter.record_idle(len(self._idle))
        self._sent = [order for order in self._sent if not order.Test()]

    def _order(self, order: DispatcherOrder, rank: int) -> None:
        """Send without waiting for the rank, which may itself be waiting for its report to be taken."""
        self._sent.append(self._communicator.isend(order, dest=rank, tag=_ORDERS))

    def _progress(self) -> JobProgress[SomeTask]:
        return JobProgress(
            running=dict(self._running),
            runs=self._runs,
            known=self._queue.known_answers,
            elapsed=self._meter.elapsed,
            seconds_left=self._seconds_left(),
        )

    def _seconds_left(self) -> float | None:
        if self._meter.mean_run is None:
            return None
        return self._meter.mean_run * self._queue.runs_left / self._communicator.Get_size()


def _send(communicator: Intracomm, message: DispatcherOrder | WorkerReport, rank: int, tag: int) -> None:
    communicator.send(message, dest=rank, tag=tag)


def _receive(communicator: Intracomm, tag: int) -> tuple[Any, int] | None:
    """Take a message of this tag and its sender, if one has come."""
    from mpi4py import MPI

    status = MPI.Status()
    message = communicator.improbe(source=MPI.ANY_SOURCE, tag=tag, status=status)
    return None if message is None else (message.recv(), status.Get_source())
