"""What an answer may cost: points × vesicles × time to simulate, over all runs, and memory."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from solver.scene import Scene
from solver.scene.scene import MOST_RECORDS

# What a run may record: it is held in memory until the run ends.
MOST_RECORDED_POINTS = 100_000_000

_ENDS = 2  # the first and the last state are recorded whatever the interval
_SERIES = 32  # diagnostics of a run, more than there are
_VESICLE_SERIES = 8  # numbers of diagnostics of each vesicle, more than there are
_AUTOMATIC_POINTS = 128  # what "auto" is counted as: most scenes end with fewer
_CONTRAST = 8.0  # how much longer a step takes with a viscosity contrast: at 64 points 5 to 9 times, measured

# Memory: with 1024 and 2048 points in all and a contrast a process used 670 and 1530 MB (`tests/README.md`).
_BASE_BYTES = 4e8
_POINT_BYTES = 8e3
_PAIR_BYTES = 300.0
_NUMBER_BYTES = 16.0  # recorded numbers are copied once when they are written


@dataclass(frozen=True)
class Cost:
    """What an answer costs at most.

    Attributes
    ----------
    runs : int
        How many runs.
    work : float
        Points × vesicles × time to simulate, over all runs.
    recorded : float
        Numbers that are recorded, over all runs.
    memory : float
        Bytes that a process needs for the largest run.
    """

    runs: int
    work: float
    recorded: float
    memory: float


def total_cost(planned_runs: Iterable[tuple[Scene, int]]) -> Cost:
    """Add the cost of runs up.

    Parameters
    ----------
    planned_runs : iterable of (Scene, int)
        A scene and how many runs cost as much as its run.

    Returns
    -------
    Cost

    Raises
    ------
    ValueError
        If a run would record more than it may; names the interval and its least value.
    """
    runs, work, recorded, memory = 0, 0.0, 0.0, 0.0
    for scene, count in planned_runs:
        _limit_output(scene)
        runs += count
        work += count * run_work(scene)
        recorded += count * recorded_numbers(scene)
        memory = max(memory, run_memory(scene))
    return Cost(runs, work, recorded, memory)


def run_work(scene: Scene) -> float:
    """Return the work of a run that goes on to the horizon.

    Parameters
    ----------
    scene : Scene
        That is run.

    Returns
    -------
    float
        Points × vesicles × time; more with a viscosity contrast.
    """
    time = scene.horizon
    if scene.start.relaxed:
        time += scene.start.horizon
    if _has_contrast(scene):
        time *= _CONTRAST
    return float(_points(scene) * time)


def recorded_numbers(scene: Scene) -> float:
    """Return how many numbers a run records that goes on to the horizon.

    Parameters
    ----------
    scene : Scene
        That is run.

    Returns
    -------
    float
        Diagnostics of every record, and positions and tensions of every recorded state.
    """
    vesicles, output = len(scene.vesicles), scene.output
    records = scene.horizon / output.interval + _ENDS
    frames = min(scene.horizon / output.frame_interval + _ENDS, records)
    return records * (_SERIES + _VESICLE_SERIES * vesicles) + frames * (1 + 2 * (_points(scene) + vesicles))


def run_memory(scene: Scene) -> float:
    """Return the memory that a run needs at most.

    Parameters
    ----------
    scene : Scene
        That is run.

    Returns
    -------
    float
        Bytes of private data of a process: the interpreter with compiled kernels, dense matrices of all
        points with each other if a viscosity contrast is solved for, and what is recorded.
    """
    points = _points(scene)
    pairs = points**2 if _has_contrast(scene) else 0
    numbers = _NUMBER_BYTES * recorded_numbers(scene)
    return _BASE_BYTES + _POINT_BYTES * points + _PAIR_BYTES * pairs + numbers


def _has_contrast(scene: Scene) -> bool:
    return any(vesicle.viscosity_contrast != 1 for vesicle in scene.vesicles)


def _points(scene: Scene) -> int:
    points = scene.numerics.points
    return len(scene.vesicles) * (_AUTOMATIC_POINTS if points == "auto" else points)


def _limit_output(scene: Scene) -> None:
    time = scene.horizon
    least = {"interval": time / MOST_RECORDS, "frame_interval": time * _points(scene) / MOST_RECORDED_POINTS}
    for name, limit in least.items():
        interval = getattr(scene.output, name)
        if interval < limit and math.isfinite(limit):  # else the work is too much anyway
            raise ValueError(f"output.{name}: {interval:g} — must be at least {limit:.3g} in so long a run")
