"""Traces a boundary with thousands of groups of ranks in simulated time, to see how busy they are.

The dispatcher, the planner, the messages as bytes and the boundary in a catalog are the real ones, and what
they take passes as time.  So does what a message of MPI and the commit of runs take, which is measured.
Simulations are not run: each takes as long as one that a store has, drawn at random, and its outcome is that
of a boundary like the real one.
"""

from __future__ import annotations

import pickle
import tempfile
import time
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from pathlib import Path
from random import Random
from statistics import fmean
from typing import TYPE_CHECKING, Any, cast

from ensemble.config.documents import load_study
from ensemble.mpi.dispatcher import Cancel, Dispatcher, Finished, Ready, Unfinished
from ensemble.mpi.end_requests import EndRequests
from ensemble.mpi.usage import UsageMeter
from ensemble.report.scaling.scaling_document import GroupsUse
from ensemble.search.point_search import SearchRun
from ensemble.search.study_planner import StudyPlanner
from ensemble.search.task_queue import RunAnswer
from ensemble.store import Store
from solver.analysis.run import Outcome

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from ensemble.store import Staged

FEWEST_RUNS = 20  # in a store, for their durations to be of use
_GROUPS_PER_POINT = 4
_MESSAGES = 2000
_COMMITS = 30  # of each kind


@dataclass(frozen=True)
class MeasuredCosts:
    """What takes time beside the simulations.

    Attributes
    ----------
    message : float
        Seconds to send a message or to take it, without its pickling.
    commit : float
        Seconds of the commit of a run.
    commit_work : float
        Those of them in which the processor works.
    further_commit : float
        Seconds of each further run that is committed with it.
    """

    message: float
    commit: float
    commit_work: float
    further_commit: float

    @classmethod
    def here(cls, store: Store, place: Path) -> MeasuredCosts:
        """Measure on this machine, with runs of a store that are committed to another one.

        Parameters
        ----------
        store : Store
            With at least `FEWEST_RUNS` runs.
        place : Path
            An existing directory, in which the other store is kept meanwhile.

        Returns
        -------
        MeasuredCosts
        """
        keys = [summary.key for summary in store.summaries()][: 2 * _COMMITS]
        half = len(keys) // 2
        with tempfile.TemporaryDirectory(dir=place) as inside, Store.open(Path(inside)) as other:
            staged = [other.stage(store.load(key)) for key in keys]
            begin, worked = time.perf_counter(), time.thread_time()
            for each in staged[:half]:
                other.commit(each)
            between, work = time.perf_counter(), time.thread_time() - worked
            other.commit_all(staged[half:])
            end = time.perf_counter()
        one = (between - begin) / half
        further = max(end - between - one, 0.0) / (len(staged) - half - 1)
        return cls(_message_seconds(), one, min(work / half, one), further)


def _message_seconds() -> float:
    from mpi4py import MPI

    communicator = MPI.COMM_SELF
    begin = time.perf_counter()
    for _ in range(_MESSAGES):
        request = communicator.isend(None, dest=0, tag=1)
        message = None
        while message is None:
            message = communicator.improbe(source=MPI.ANY_SOURCE, tag=1)
        message.recv()
        request.wait()
    return (time.perf_counter() - begin) / _MESSAGES


def simulate_groups(groups: int, durations: list[float], costs: MeasuredCosts, place: Path) -> GroupsUse:
    """Trace the boundary of a study on so many groups.

    Parameters
    ----------
    groups : int
        How many.
    durations : list of float
        Seconds of runs.
    costs : MeasuredCosts
        What else takes time.
    place : Path
        An existing directory, in which a catalog is kept meanwhile.

    Returns
    -------
    GroupsUse
        What the groups and the dispatcher did.
    """
    points = max(1, groups // _GROUPS_PER_POINT)
    rates = [0.25 + 1.25 * index / points for index in range(points)]
    planner = StudyPlanner(load_study("critical-hamaker", [f"sweep.values={rates}"]), lambda key: None)
    with tempfile.TemporaryDirectory(dir=place) as inside, Store.open(Path(inside)) as catalog:
        clock = _SimulatedTime()
        meter = UsageMeter(groups, clock.monotonic)
        dispatcher: Dispatcher[SearchRun] = Dispatcher(
            cast("Intracomm", _SimulatedGroups(groups, durations, clock, costs.message)),
            planner,
            cast(Store, _CommittingStore(clock, costs)),
            lambda progress: catalog.save_boundary(planner.boundary()),
            meter,
            EndRequests(None),
            clock,
        )
        usage = dispatcher.run()
    assert usage is not None  # nobody asks it to end
    return GroupsUse(
        groups=groups,
        points=points,
        run_seconds=fmean(durations),
        runs=usage.runs,
        wall_seconds=usage.wall_seconds,
        busy=fmean(usage.busy_fractions),
        dispatcher_share=clock.worked / usage.wall_seconds,
        dispatcher_seconds_a_run=clock.worked / usage.runs,
    )


class _SimulatedTime:
    """The dispatcher's clock: its work passes as it takes, and sleeping takes none."""

    def __init__(self) -> None:
        self._begin = time.thread_time()
        self._slept = 0.0
        self._charged = 0.0

    @property
    def worked(self) -> float:
        """Seconds in which the dispatcher has worked."""
        return time.thread_time() - self._begin + self._charged

    def charge(self, seconds: float) -> None:
        """Count work that is not done here."""
        self._charged += seconds

    def monotonic(self) -> float:
        return self.worked + self._slept

    def thread_time(self) -> float:
        return self.worked

    def sleep(self, seconds: float, /) -> None:
        self._slept += seconds


class _TakenOrder:
    """The request of a message that has been taken."""

    def Test(self) -> bool:  # noqa: N802  the name in mpi4py
        return True

    def wait(self) -> None:
        """Return at once."""


class _SimulatedGroups:
    """A communicator as the dispatcher sees it: groups whose runs take as long as recorded ones."""

    def __init__(
        self, groups: int, durations: list[float], clock: _SimulatedTime, message_seconds: float
    ) -> None:
        self._groups = groups
        self._durations = durations
        self._clock = clock
        self._message_seconds = message_seconds
        self._random = Random(1)
        self._order = count()
        self._reports: list[tuple[float, int, bytes, int]] = []
        self._running: dict[int, tuple[str, float, int]] = {}  # key, begin and number of the report by rank
        self._void: set[int] = set()
        for rank in range(groups):
            self._report(0.0, Ready(), rank)

    def Get_size(self) -> int:  # noqa: N802  the name in mpi4py
        return self._groups

    def isend(self, order: Any, dest: int, tag: int) -> _TakenOrder:
        pickle.dumps(order)
        self._clock.charge(self._message_seconds)
        now = self._clock.monotonic()
        if isinstance(order, SearchRun):
            seconds = self._random.choice(self._durations)
            report = Finished(cast("Staged", None), _answer(order), seconds)
            self._running[dest] = (order.key, now, self._report(now + seconds, report, dest))
        elif isinstance(order, Cancel) and dest in self._running:
            key, begin, number = self._running[dest]
            if key == order.key:
                self._void.add(number)
                del self._running[dest]
                self._report(now, Unfinished(now - begin), dest)
        return _TakenOrder()

    def improbe(self, source: int, tag: int, status: Any) -> _SimulatedGroups | None:
        while self._reports and self._reports[0][1] in self._void:
            heappop(self._reports)
        if not self._reports or self._reports[0][0] > self._clock.monotonic():
            return None
        status.Set_source(self._reports[0][3])
        return self

    def recv(self) -> Any:
        _, number, report, rank = heappop(self._reports)
        self._clock.charge(self._message_seconds)
        if rank in self._running and self._running[rank][2] == number:
            del self._running[rank]
        return pickle.loads(report)

    def _report(self, when: float, report: Any, rank: int) -> int:
        number = next(self._order)
        heappush(self._reports, (when, number, pickle.dumps(report), rank))
        return number


def _answer(task: SearchRun) -> RunAnswer:
    bound = task.value > 0.1 + 0.571 * task.at[0]  # nearly the boundary of the default study
    return RunAnswer(Outcome.BOUND if bound else Outcome.SEPARATED)


class _CommittingStore:
    """Charges the commit of runs without making it."""

    def __init__(self, clock: _SimulatedTime, costs: MeasuredCosts) -> None:
        self._clock = clock
        self._costs = costs

    def commit_all(self, staged: list[Staged]) -> None:
        self._clock.charge(self._costs.commit_work + self._costs.further_commit * (len(staged) - 1))
        self._clock.sleep(self._costs.commit - self._costs.commit_work)  # the disk works
