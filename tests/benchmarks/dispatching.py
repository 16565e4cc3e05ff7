"""Reports a second that the dispatcher of a study handles, against the number of points and ranks.

    python -m tests.benchmarks.dispatching

The dispatcher, the planner and the catalog are the real ones.  The ranks are not: every run takes no time and
its outcome is that of a boundary like the real one.  So the figures are what rank 0 can do at most.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from ensemble.config.documents import load_study
from ensemble.mpi.dispatcher import Dispatcher, Finished, Ready
from ensemble.mpi.end_requests import EndRequests
from ensemble.mpi.usage import UsageMeter
from ensemble.search.point_search import SearchRun
from ensemble.search.study_planner import StudyPlanner
from ensemble.search.task_queue import RunAnswer
from ensemble.store import Store
from solver.analysis.run import Outcome

SIZES = ((6, 64), (64, 64), (256, 1024), (1024, 4096))  # points, ranks
SECONDS = 20.0


class TimeOverError(Exception):
    """The time is over."""


class TakenOrder:
    """Stands in for the request of a message that has been taken."""

    def Test(self) -> bool:  # noqa: N802  the name in mpi4py
        return True

    def wait(self) -> None:
        pass


class InstantRanks:
    """Stands in for a communicator: ranks that answer every order at once, in the order of the orders."""

    def __init__(self, ranks: int, until: Callable[[], bool]) -> None:
        self._ranks = ranks
        self._until = until
        self._reports: deque[tuple[Any, int]] = deque((Ready(), rank) for rank in range(ranks))
        self.finished = 0

    def Get_size(self) -> int:  # noqa: N802  the name in mpi4py
        return self._ranks

    def isend(self, order: Any, dest: int, tag: int) -> TakenOrder:
        if isinstance(order, SearchRun):
            self._reports.append((Finished(None, answer(order), 1.0), dest))  # type: ignore[arg-type]
        return TakenOrder()

    def improbe(self, source: int, tag: int, status: Any) -> InstantRanks | None:
        if self._until():
            raise TimeOverError
        if not self._reports:
            return None
        status.Set_source(self._reports[0][1])
        return self

    def recv(self) -> Any:
        report, _ = self._reports.popleft()
        self.finished += isinstance(report, Finished)
        return report


class BoundaryStore:
    """A store that keeps boundaries in a real catalog, and takes runs without writing them."""

    def __init__(self, store: Store) -> None:
        self.save_boundary = store.save_boundary

    def commit_all(self, staged: Any) -> None:
        pass


def answer(task: SearchRun) -> RunAnswer:
    bound = task.value > 0.1 + 0.571 * task.at[0]
    return RunAnswer(Outcome.BOUND if bound else Outcome.SEPARATED)


def reports_a_second(points: int, ranks: int, seconds: float, changes: list[str]) -> float:
    """Dispatch a study for a while, or to its end."""
    rates = [0.25 + 1.25 * index / points for index in range(points)]
    study = load_study("critical-hamaker", [f"sweep.values={rates}", *changes])
    planner = StudyPlanner(study, lambda key: None)
    with tempfile.TemporaryDirectory() as place, Store.open(Path(place)) as store:
        boundaries = BoundaryStore(store)
        begin = time.perf_counter()
        communicator = InstantRanks(ranks, lambda: time.perf_counter() - begin > seconds)

        def publish(progress: Any) -> None:
            boundaries.save_boundary(planner.boundary())

        meter = UsageMeter(ranks, time.perf_counter)
        dispatcher = Dispatcher(communicator, planner, boundaries, publish, meter, EndRequests(None))  # type: ignore[arg-type]
        with suppress(TimeOverError):
            dispatcher.run()
        return communicator.finished / (time.perf_counter() - begin)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=SECONDS, help="for each size, at most")
    parser.add_argument(
        "--set", action="append", default=[], dest="changes", help="as ensemble bisect takes it"
    )
    arguments = parser.parse_args()
    reports_a_second(1, 1, arguments.seconds, arguments.changes)  # imports what is imported when it is needed
    for points, ranks in SIZES:
        rate = reports_a_second(points, ranks, arguments.seconds, arguments.changes)
        print(f"{points:5d} points, {ranks:5d} ranks: {rate:8.0f} runs a second", flush=True)


if __name__ == "__main__":
    main()
