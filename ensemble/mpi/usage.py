"""How much of its time each group of ranks of a job spends in simulations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class RunUsage:
    """What it took to make the runs of a job.

    Attributes
    ----------
    runs : int
        How many were made.
    wall_seconds : float
        From the first report to the last order.
    busy_fractions : tuple of float
        For each group of ranks the share of the time that it spent in simulations, from the start to the
        moment from which on some group found nothing useful left to run.  Empty if the store had all answers.
    """

    runs: int
    wall_seconds: float
    busy_fractions: tuple[float, ...]


class UsageMeter:
    """Measures how much of its time each group spends in simulations.

    Time counts until the moment from which on some group has nothing useful left to run.  What is left then
    cannot be divided further, so it says nothing about the schedule.

    Parameters
    ----------
    groups : int
        How many there are.
    clock : callable
        Returns seconds; the first reading is the start.
    """

    def __init__(self, groups: int, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._start = clock()
        self._intervals: list[list[tuple[float, float]]] = [[] for _ in range(groups)]
        self._later_runs = 0
        self._later_seconds = 0.0
        self._first_idle: float | None = None

    @property
    def elapsed(self) -> float:
        """Time since the start, in seconds."""
        return self._clock() - self._start

    @property
    def mean_run(self) -> float | None:
        """Mean seconds of a run, but for each group's first, which waits for the kernels; None at first."""
        return self._later_seconds / self._later_runs if self._later_runs else None

    def record_run(self, group: int, seconds: float) -> None:
        """Record that a group has just finished a simulation.

        Parameters
        ----------
        group : int
            Index of the group.
        seconds : float
            That the simulation took.
        """
        now = self._clock()
        if self._intervals[group]:
            self._later_runs += 1
            self._later_seconds += seconds
        self._intervals[group].append((now - seconds, now))

    def record_idle(self, groups: int) -> None:
        """Record how many groups wait although every useful run is being made.

        Parameters
        ----------
        groups : int
            How many wait.
        """
        if groups == 0:
            self._first_idle = None
        elif self._first_idle is None:
            self._first_idle = self._clock()

    def fractions(self) -> tuple[float, ...]:
        """Return the busy share of the time of each group; empty if nothing ran."""
        if not any(self._intervals):
            return ()
        end = self._clock() if self._first_idle is None else self._first_idle
        return tuple(
            sum(max(0.0, min(stop, end) - begin) for begin, stop in intervals) / (end - self._start)
            for intervals in self._intervals
        )
