"""Runs a study on all ranks of a communicator.

Every rank simulates.  Rank 0 also runs the coordinator, in a thread beside its own simulations: it alone
decides what is run next and alone writes to the database, so ranks never contend for either.  All ranks,
rank 0 and a rank that is alone included, talk to it by the same messages.

A blocking receive would spin and take the core from the simulation, so both sides poll with short sleeps.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

from ensemble.coordinator import Coordinator
from ensemble.inquiry import Task
from ensemble.mpi import abort_guard

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from ensemble.boundary import Boundary
    from ensemble.store import Staged, Store
    from ensemble.study import Study
    from solver.run import Outcome

_ORDERS = 1  # tag of messages to workers
_REPORTS = 2  # tag of messages to the coordinator
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
    """Report: this rank waits for its first task."""


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
class Snapshot:
    """Where a study stands."""

    boundary: Boundary
    running: Mapping[int, Task]  # by rank
    runs: int  # finished so far, without those that the store already had
    known: int  # answers that the store already had
    elapsed: float  # seconds
    seconds_left: float | None  # estimate, None before the first run is finished


@dataclass(frozen=True)
class Traced:
    """A study's result, and what it cost.

    `busy_fractions` holds one number a rank: the share of the time that it spent in simulations, from the
    start to the moment from which on some rank found nothing useful left to run.  It is empty when
    the store had every answer.
    """

    boundary: Boundary
    runs: int
    wall_seconds: float
    busy_fractions: tuple[float, ...]


def trace(
    communicator: Intracomm, study: Study, store: Store, on_change: Callable[[Snapshot], None]
) -> Traced:
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

    Returns
    -------
    Traced
        On every rank.
    """
    private = communicator.Dup()
    traced: Traced | None = None
    if private.Get_rank() == 0:
        dispatcher = _Dispatcher(private, study, store, on_change)
        with ThreadPoolExecutor(1, "coordinator") as beside:
            coordination = beside.submit(dispatcher.run)
            _work(private, store)
            traced = coordination.result()
    else:
        _work(private, store)
    traced = private.bcast(traced)
    private.Free()
    return cast(Traced, traced)


def _work(communicator: Intracomm, store: Store) -> None:
    """Simulate what the coordinator orders until it says stop."""
    with abort_guard(communicator):
        _send(communicator, Ready(), 0, _REPORTS)
        while not isinstance(order := _wait(communicator), Stop):
            # A cancellation that crossed the report of the run it names has nothing left to stop.
            if isinstance(order, Task):
                _send(communicator, _simulate(communicator, store, order), 0, _REPORTS)


def _wait(communicator: Intracomm) -> Order:
    while (received := _receive(communicator, _ORDERS)) is None:
        time.sleep(_POLL_SECONDS)
    return cast(Order, received[0])


def _simulate(communicator: Intracomm, store: Store, task: Task) -> Report:
    # A study whose answers are all in the store never needs the compiled kernels.
    from solver.simulate import Cancelled, simulate

    begin = time.perf_counter()
    try:
        run = simulate(task.scene, should_stop=_Cancellation(communicator, task.key))
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


class _Dispatcher:
    """Answers reports with orders until no search needs anything more."""

    def __init__(
        self,
        communicator: Intracomm,
        study: Study,
        store: Store,
        on_change: Callable[[Snapshot], None],
    ) -> None:
        self._communicator = communicator
        self._study = study
        self._store = store
        self._on_change = on_change
        self._running: dict[int, Task] = {}
        self._idle: set[int] = set()
        self._cancelled: set[str] = set()
        self._runs = 0
        self._usage = Usage(communicator.Get_size(), time.perf_counter)

    def run(self) -> Traced:
        """Coordinate from the first report to the last order."""
        with abort_guard(self._communicator):
            made = (summary.scene for summary in self._store.summaries())
            coordinator = Coordinator(self._study, self._store.outcome, made)
            while len(self._idle) < self._communicator.Get_size() or not coordinator.done:
                report, rank = self._wait()
                self._take(coordinator, report, rank)
                self._cancel_pointless(coordinator)
                self._assign(coordinator)
                self._publish(coordinator)
            for rank in self._idle:
                _send(self._communicator, Stop(), rank, _ORDERS)
            return Traced(
                boundary=coordinator.boundary(),
                runs=self._runs,
                wall_seconds=self._usage.elapsed,
                busy_fractions=self._usage.fractions(),
            )

    def _wait(self) -> tuple[Report, int]:
        while (received := _receive(self._communicator, _REPORTS)) is None:
            time.sleep(_POLL_SECONDS)
        return cast(tuple[Report, int], received)

    def _take(self, coordinator: Coordinator, report: Report, rank: int) -> None:
        match report:
            case Finished(staged, outcome, seconds):
                task = self._running.pop(rank)
                self._store.commit(staged)
                coordinator.answer(task, outcome)
                self._runs += 1
                self._usage.ran(rank, seconds)
            case Stopped(seconds):
                coordinator.cancelled(self._running.pop(rank))
                self._usage.ran(rank, seconds)
        self._idle.add(rank)

    def _cancel_pointless(self, coordinator: Coordinator) -> None:
        pointless = {task.key for task in coordinator.pointless_tasks()}
        for rank, task in self._running.items():
            if task.key in pointless - self._cancelled:
                _send(self._communicator, Cancel(task.key), rank, _ORDERS)
                self._cancelled.add(task.key)

    def _assign(self, coordinator: Coordinator) -> None:
        for rank in sorted(self._idle):
            task = coordinator.next_task()
            if task is None:
                break
            self._cancelled.discard(task.key)
            self._running[rank] = task
            self._idle.remove(rank)
            _send(self._communicator, task, rank, _ORDERS)
        self._usage.idle(len(self._idle))

    def _publish(self, coordinator: Coordinator) -> None:
        boundary = coordinator.boundary()
        self._store.save_boundary(boundary)
        self._on_change(
            Snapshot(
                boundary=boundary,
                running=dict(self._running),
                runs=self._runs,
                known=coordinator.known_answers,
                elapsed=self._usage.elapsed,
                seconds_left=self._seconds_left(coordinator),
            )
        )

    def _seconds_left(self, coordinator: Coordinator) -> float | None:
        if self._usage.mean_run is None:
            return None
        return self._usage.mean_run * coordinator.runs_left / self._communicator.Get_size()


class Usage:
    """How much of its time each rank spends in simulations.

    Time counts until the moment from which on some rank has nothing useful left to run: what is left then
    cannot be divided further, so it says nothing about the schedule.

    Parameters
    ----------
    ranks : int
    clock : callable
        Seconds; the first reading is the start.
    """

    def __init__(self, ranks: int, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._start = clock()
        self._intervals: list[list[tuple[float, float]]] = [[] for _ in range(ranks)]
        self._dry: float | None = None

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return self._clock() - self._start

    @property
    def mean_run(self) -> float | None:
        """Mean seconds of the runs so far; None before the first."""
        runs = [end - begin for intervals in self._intervals for begin, end in intervals]
        return sum(runs) / len(runs) if runs else None

    def ran(self, rank: int, seconds: float) -> None:
        """Record that a rank has just come back from `seconds` of simulation."""
        now = self._clock()
        self._intervals[rank].append((now - seconds, now))

    def idle(self, ranks: int) -> None:
        """Record how many ranks wait although every useful run is being made."""
        if ranks == 0:
            self._dry = None
        elif self._dry is None:
            self._dry = self._clock()

    def fractions(self) -> tuple[float, ...]:
        """Busy share of the time of each rank; empty when nothing ran."""
        if not any(self._intervals):
            return ()
        end = self._clock() if self._dry is None else self._dry
        return tuple(
            sum(max(0.0, min(stop, end) - begin) for begin, stop in intervals) / (end - self._start)
            for intervals in self._intervals
        )


def _send(communicator: Intracomm, message: Order | Report, rank: int, tag: int) -> None:
    communicator.send(message, dest=rank, tag=tag)


def _receive(communicator: Intracomm, tag: int) -> tuple[Any, int] | None:
    """Take a message of this tag and its sender, if one has come."""
    from mpi4py import MPI

    status = MPI.Status()
    message = communicator.improbe(source=MPI.ANY_SOURCE, tag=tag, status=status)
    return None if message is None else (message.recv(), status.Get_source())
