"""Replays a study of thousands of groups in simulated time: are they busy, and the dispatcher not?

    ensemble bisect --store STORE && python -m tests.benchmarks.replay STORE

The dispatcher, the planner, the messages as bytes and the boundaries in a catalog are the real ones, and what
they take passes as time.  So does what a message of MPI and the commit of a run take, both measured at
the start.  The simulations are not run: each takes as long as one that STORE has, drawn at random, or so many
times as long, and its outcome is that of a boundary like the real one.
"""

from __future__ import annotations

import argparse
import json
import pickle
import tempfile
import time
from dataclasses import asdict, dataclass
from heapq import heappop, heappush
from itertools import count
from pathlib import Path
from random import Random
from statistics import fmean
from typing import Any
from unittest.mock import patch

from mpi4py import MPI

from ensemble.config.documents import load_study
from ensemble.mpi import dispatcher
from ensemble.mpi.dispatcher import Cancel, Dispatcher, Finished, Ready, Unfinished
from ensemble.mpi.end_requests import EndRequests
from ensemble.mpi.usage import UsageMeter
from ensemble.search.point_search import SearchRun
from ensemble.search.study_planner import StudyPlanner
from ensemble.store import Store
from tests.benchmarks.dispatching import TakenOrder, answer
from tests.ensemble.runs import shear_run, shear_scene

MESSAGES = 2000
COMMITS = 100


class SimulatedTime:
    """Stands in for `time` in the dispatcher: its work passes as it takes, and sleeping takes none."""

    def __init__(self) -> None:
        self._begin = time.thread_time()
        self.slept = 0.0
        self.charged = 0.0

    @property
    def worked(self) -> float:
        """Seconds in which the coordinator has worked."""
        return time.thread_time() - self._begin + self.charged

    def thread_time(self) -> float:
        return self.worked

    def monotonic(self) -> float:
        return self.worked + self.slept

    def sleep(self, seconds: float) -> None:
        self.slept += seconds


@dataclass
class SimulatedGroups:
    """Stands in for a communicator: groups whose runs take as long as recorded ones."""

    groups: int
    durations: list[float]
    clock: SimulatedTime
    message_seconds: float

    def __post_init__(self) -> None:
        self._random = Random(1)
        self._order = count()
        self._reports: list[tuple[float, int, bytes, int]] = []
        self._running: dict[int, tuple[str, float, int]] = {}  # key, begin and number of the report by rank
        self._void: set[int] = set()
        for rank in range(self.groups):
            self._report(0.0, Ready(), rank)

    def Get_size(self) -> int:  # noqa: N802  the name in mpi4py
        return self.groups

    def isend(self, order: Any, dest: int, tag: int) -> TakenOrder:
        pickle.dumps(order)
        self.clock.charged += self.message_seconds
        now = self.clock.monotonic()
        if isinstance(order, SearchRun):
            seconds = self._random.choice(self.durations)
            report = Finished(None, answer(order), seconds)  # type: ignore[arg-type]
            self._running[dest] = (order.key, now, self._report(now + seconds, report, dest))
        elif isinstance(order, Cancel) and dest in self._running:
            key, begin, number = self._running[dest]
            if key == order.key:
                self._void.add(number)
                del self._running[dest]
                self._report(now, Unfinished(now - begin), dest)
        return TakenOrder()

    def improbe(self, source: int, tag: int, status: Any) -> SimulatedGroups | None:
        while self._reports and self._reports[0][1] in self._void:
            heappop(self._reports)
        if not self._reports or self._reports[0][0] > self.clock.monotonic():
            return None
        status.Set_source(self._reports[0][3])
        return self

    def recv(self) -> Any:
        _, number, report, rank = heappop(self._reports)
        self.clock.charged += self.message_seconds
        if rank in self._running and self._running[rank][2] == number:
            del self._running[rank]
        return pickle.loads(report)

    def _report(self, when: float, report: Any, rank: int) -> int:
        number = next(self._order)
        heappush(self._reports, (when, number, pickle.dumps(report), rank))
        return number


@dataclass(frozen=True)
class CommitCosts:
    """Seconds that the commit of runs takes."""

    one: float
    more: float  # each further one that is committed with it
    working: float  # processor time of the first


class CommittingStore:
    """A store that keeps boundaries in a real catalog, and charges the commit of runs without making it."""

    def __init__(self, store: Store, clock: SimulatedTime, costs: CommitCosts) -> None:
        self.save_boundary = store.save_boundary
        self._clock = clock
        self._costs = costs

    def commit_all(self, staged: Any) -> None:
        self._clock.charged += self._costs.working + self._costs.more * (len(staged) - 1)
        self._clock.sleep(self._costs.one - self._costs.working)  # the disk works


def message_seconds() -> float:
    """Measure what it takes to send a message and to take it, without its pickling."""
    communicator = MPI.COMM_SELF
    begin = time.perf_counter()
    for _ in range(MESSAGES):
        request = communicator.isend(None, dest=0, tag=1)
        message = None
        while message is None:
            message = communicator.improbe(source=MPI.ANY_SOURCE, tag=1)
        message.recv()
        request.wait()
    return (time.perf_counter() - begin) / MESSAGES


def commit_costs() -> CommitCosts:
    """Measure what the commit of runs takes, one by one and together, files included."""
    with tempfile.TemporaryDirectory() as place, Store.open(Path(place)) as store:
        staged = [store.stage(shear_run(shear_scene(rate=0.5 + 0.001 * each))) for each in range(2 * COMMITS)]
        begin, worked = time.perf_counter(), time.thread_time()
        for each in staged[:COMMITS]:
            store.commit(each)
        between, working = time.perf_counter(), time.thread_time() - worked
        store.commit_all(staged[COMMITS:])
        one = (between - begin) / COMMITS
        return CommitCosts(one, (time.perf_counter() - between - one) / (COMMITS - 1), working / COMMITS)


def replay(
    points: int, groups: int, durations: list[float], costs: tuple[float, CommitCosts]
) -> dict[str, Any]:
    """Trace a study on simulated groups and return the figures."""
    message, commit = costs
    rates = [0.25 + 1.25 * index / points for index in range(points)]
    planner = StudyPlanner(load_study("critical-hamaker", [f"sweep.values={rates}"]), lambda key: None)
    with tempfile.TemporaryDirectory() as place, Store.open(Path(place)) as opened:
        clock = SimulatedTime()
        store = CommittingStore(opened, clock, commit)
        communicator = SimulatedGroups(groups, durations, clock, message)
        meter = UsageMeter(groups, clock.monotonic)
        with patch.object(dispatcher, "time", clock):
            coordinator: Dispatcher[SearchRun] = Dispatcher(
                communicator,  # type: ignore[arg-type]
                planner,
                store,  # type: ignore[arg-type]
                lambda progress: store.save_boundary(planner.boundary()),
                meter,
                EndRequests(None),
            )
            usage = coordinator.run()
    return {
        "points": points,
        "groups": groups,
        "mean seconds of a run": fmean(durations),
        "runs": usage.runs,
        "wall seconds": usage.wall_seconds,
        "busy while work lasts": fmean(usage.busy_fractions),
        "share of the coordinator in rank 0": clock.worked / usage.wall_seconds,
        "its seconds a run": clock.worked / usage.runs,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("store", type=Path, help="from which the durations are taken")
    parser.add_argument("--groups", type=int, nargs="+", default=[16, 256, 4096])
    parser.add_argument("--points-per-group", type=float, default=0.25)
    parser.add_argument("--times", type=float, nargs="+", default=[1.0, 100.0], help="as long as recorded")
    options = parser.parse_args()
    with Store.existing(options.store) as store:
        recorded = [summary.work.wall_seconds for summary in store.summaries()]
    costs = message_seconds(), commit_costs()
    print(json.dumps({"seconds of a message": costs[0], "seconds of a commit": asdict(costs[1])}))
    for groups in options.groups:
        for times in options.times:
            points = max(1, round(groups * options.points_per_group))
            durations = [times * seconds for seconds in recorded]
            print(json.dumps(replay(points, groups, durations, costs)), flush=True)


if __name__ == "__main__":
    main()
