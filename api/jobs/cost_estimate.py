"""What a job may cost, before it is accepted: points × vesicles × time to simulate, over all of its runs."""

from __future__ import annotations

import math
import sys

from pydantic import BaseModel

from ensemble.config.certifying_scene import certifying_scene
from ensemble.config.geometric_grid import GeometricGrid
from ensemble.config.study import Study
from ensemble.errors import BadInput
from solver.scene import Scene

# What a run may record: it is held in memory until the run ends.
MOST_RECORDS = 1_000_000
MOST_RECORDED_POINTS = 100_000_000

_AUTOMATIC_POINTS = 128  # what "auto" is taken for: most scenes end with fewer
_CONTRAST = 8.0  # how much longer a step takes with a viscosity contrast: at 64 points 5 to 9 times, measured


class Estimate(BaseModel):
    """Upper bound of the cost of a job: points × vesicles × time to simulate, over all its `runs`.

    A job whose `cost` is above `maximum` is refused.
    """

    runs: int
    cost: float
    maximum: float
    accepted: bool


def estimate(asked: Study | Scene, maximum: float) -> Estimate:
    """Estimate the cost of a study or a scene and compare it with the maximum.

    A run may go on to the end of its extended horizon; a search halves its limits down to its tolerance.

    Raises
    ------
    BadInput
        If a run would record more than it may; names the interval and its least value.
    """
    runs, cost = _of_study(asked) if isinstance(asked, Study) else (1, _of_run(asked))
    # An infinite cost is above any maximum, but JSON has no word for it.
    return Estimate(runs=runs, cost=min(cost, sys.float_info.max), maximum=maximum, accepted=cost <= maximum)


def _of_run(scene: Scene) -> float:
    _limit_output(scene)
    time = scene.horizon * scene.criteria.extensions
    if scene.start.relaxed:
        time += scene.start.horizon
    if any(vesicle.viscosity_contrast != 1 for vesicle in scene.vesicles):
        time *= _CONTRAST
    return float(_points(scene) * time)


def _points(scene: Scene) -> int:
    points = scene.numerics.points
    return len(scene.vesicles) * (_AUTOMATIC_POINTS if points == "auto" else points)


def _limit_output(scene: Scene) -> None:
    time = scene.horizon * scene.criteria.extensions
    least = {"interval": time / MOST_RECORDS, "frame_interval": time * _points(scene) / MOST_RECORDED_POINTS}
    for name, limit in least.items():
        asked = getattr(scene.output, name)
        if asked < limit and math.isfinite(limit):  # else the cost is too large, too
            raise BadInput(f"output.{name}: {asked:g} — must be at least {limit:.3g} in so long a run")


def _of_study(study: Study) -> tuple[int, float]:
    low, high = study.search.limits
    candidates = len(GeometricGrid(study.search.tolerance).within(low, high))
    searching = math.ceil(math.log2(candidates)) + 2  # both limits, then halves
    runs, cost = 0, 0.0
    for value in study.sweep.values:
        dearest = max((study.scene_at(value, limit) for limit in (low, high)), key=_of_run)
        runs += searching
        cost += searching * _of_run(dearest)
        if study.search.certify:
            runs += 2
            cost += 2 * _of_run(certifying_scene(dearest))
    return runs, cost
