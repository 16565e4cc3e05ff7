"""How long a job is likely to take: as long as the newest runs of the store that are like its own."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from statistics import fmean
from threading import Lock
from typing import Any, NamedTuple

from cachetools import TTLCache

from api.jobs.submissions import Estimate
from ensemble.questions import Question
from ensemble.store import Store
from ensemble.store.listing import Listing
from solver.analysis.run import Outcome
from solver.scene import Scene

NEWEST = 400  # runs that are looked at
KEPT_SECONDS = 10.0  # for which what they took is kept

_DECIDED_BY_THE_HORIZON = (Outcome.UNDECIDED, Outcome.COMPLETED)
_TRIMMED = 10  # of so many runs the quickest and the slowest one are left out
_LEAST_TRIMMED = 3


class _Likeness(NamedTuple):
    """What runs share that take about as long."""

    vesicles: int
    flow: str | None
    has_contrast: bool

    @classmethod
    def of(cls, scene: Mapping[str, Any]) -> _Likeness:
        """Return that of a scene as JSON data."""
        vesicles = scene["vesicles"]
        contrast = any(vesicle.get("viscosity_contrast", 1.0) != 1 for vesicle in vesicles)
        return cls(len(vesicles), (scene.get("flow") or {}).get("kind"), contrast)


class _PastRun(NamedTuple):
    """What a run took."""

    seconds: float
    points: int
    time: float
    is_decided: bool

    def seconds_of(self, points: int | None, horizon: float) -> float:
        """Return what it would have taken with other points and another horizon."""
        share = horizon / self.time if self.time > 0 else 1.0
        if self.is_decided:
            share = min(share, 1.0)
        return self.seconds * share * ((points or self.points) / self.points)


class ExpectedTimes:
    """Tells how long jobs are likely to take, from any thread.

    Parameters
    ----------
    store : Store
        Whose runs are looked at.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._kept: TTLCache[str, Mapping[_Likeness, list[_PastRun]]] = TTLCache(1, ttl=KEPT_SECONDS)
        self._lock = Lock()

    def added(self, estimate: Estimate, question: Question[Any], ranks: int) -> Estimate:
        """Return an estimate with the time that a job is likely to take.

        Parameters
        ----------
        estimate : Estimate
            Of the question.
        question : Question
            What the job answers.
        ranks : int
            How many processes it uses.

        Returns
        -------
        Estimate
        """
        return estimate.model_copy(update={"ranks": ranks, "seconds": self._seconds(question, ranks)})

    def _seconds(self, question: Question[Any], ranks: int) -> float | None:
        past = self._past_runs()
        total = 0.0
        for scene, count in question.planned_runs():
            if count == 0:
                continue
            alike = past.get(_Likeness.of(scene.model_dump(include={"vesicles", "flow"})))
            if not alike:
                return None
            total += count * _usual_seconds(alike, scene)
        return total / ranks if question.has_many_runs else total

    def _past_runs(self) -> Mapping[_Likeness, list[_PastRun]]:
        with self._lock:
            if "" not in self._kept:
                self._kept[""] = self._read()
            return self._kept[""]

    def _read(self) -> Mapping[_Likeness, list[_PastRun]]:
        past = defaultdict(list)
        for record in self._store.run_records(Listing(limit=NEWEST)):
            run = json.loads(record.json)
            outcome, work = run["outcome"], run["work"]
            seconds, time = work["wall_seconds"], run["time"]
            points = work.get("points")  # old records lack it
            if outcome == Outcome.FAILED or points is None:
                continue
            is_decided = outcome not in _DECIDED_BY_THE_HORIZON
            past[_Likeness.of(run["scene"])].append(_PastRun(seconds, points, time, is_decided))
        return past


def _usual_seconds(alike: Sequence[_PastRun], scene: Scene) -> float:
    """Return the mean over runs, without the extremes: the first run on a machine compiles the kernels."""
    points = None if scene.numerics.points == "auto" else scene.numerics.points
    seconds = sorted(run.seconds_of(points, scene.horizon) for run in alike)
    trimmed = max(len(seconds) // _TRIMMED, 1) if len(seconds) >= _LEAST_TRIMMED else 0
    return fmean(seconds[trimmed : len(seconds) - trimmed])
