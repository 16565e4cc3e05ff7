"""How much of its time each group of ranks of a job spends in simulations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class RunUsage:
    """What it took to make the runs of a job.

    `busy_fractions` holds one number a group: the share of the time that it spent in simulations, from the
    start to the moment from which on some group found nothing useful left to run.  It is empty when
    the store had every answer.
    """

    runs: int
    wall_seconds: float
    busy_fractions: tuple[float, ...]


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
