"""Error against run time: of positions, over integrators, tolerances and numbers of points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np

from ensemble.config.run_key import run_key
from ensemble.report.answers import Answer, Critical, answers, critical_values
from ensemble.report.envelope import Envelope, envelopes
from ensemble.report.machine import Machine
from ensemble.report.measurement import Measurement
from ensemble.report.methods import Method, Plan
from ensemble.report.report_model import Document
from ensemble.report.runs import Runs
from ensemble.report.shape import final_membranes, shape_distance
from solver.analysis.run import Array, Outcome, Run
from solver.scene import Scene

# A fit leaves out what lies within this factor of the least error at the same number of points, where the
# error in space, or the converged run's own, shows instead of the integrator's.
FLOOR = 3.0


class Reference(Document):
    """The converged run of a scene.

    uncertainty : largest distance of the control run's membranes from it.
    """

    scene: str
    points: int
    tolerance: float
    uncertainty: float
    wall_seconds: float
    run_key: str


class Slope(Document):
    """Observed order: error ∝ evaluations^(−order), by least squares; None with fewer than two points."""

    scene: str
    method: str
    points: int
    order: float | None
    fitted: int


class WorkPrecision(Document):
    """The whole report."""

    report: str = "work-precision"
    machine: Machine
    references: list[Reference]
    measurements: list[Measurement]
    slopes: list[Slope]
    envelopes: list[Envelope]
    answers: list[Answer]
    critical_values: list[Critical]


def work_precision(runs: Runs, plan: Plan, scenes: Mapping[str, Scene]) -> WorkPrecision:
    """Measure every method in every scene, and the default one in its answers.

    Parameters
    ----------
    runs : Runs
    plan : Plan
    scenes : mapping from name to Scene
        They must end at their horizon, whatever happens in them.

    Raises
    ------
    ArithmeticError
        If a converged run fails.
    """
    references, measurements = [], []
    for name, scene in scenes.items():
        reference, membranes = _reference(runs, plan, name, scene)
        references.append(reference)
        for method in plan.methods:
            for points in plan.points:
                measurements += _series(runs, plan, (name, scene), method, points, membranes)
    return WorkPrecision(
        machine=Machine.here(),
        references=references,
        measurements=measurements,
        slopes=slopes(measurements),
        envelopes=envelopes(scenes, measurements),
        answers=answers(runs, plan),
        critical_values=critical_values(runs, plan),
    )


def position_error(run: Run, membranes: Array) -> tuple[float, float]:
    """Root mean square and maximum, over all membrane points, of the distance from converged membranes."""
    distances = np.concatenate(
        [shape_distance(points, other) for points, other in zip(final_membranes(run), membranes, strict=True)]
    )
    return float(np.sqrt(np.mean(distances**2))), float(distances.max())


def slopes(measurements: Sequence[Measurement]) -> list[Slope]:
    """Fit the observed orders; see `FLOOR` for what is left out."""
    least: dict[tuple[str, int], float] = {}
    for point in measurements:
        if point.error_rms is not None:
            place = point.scene, point.points
            least[place] = min(least.get(place, np.inf), point.error_rms)
    found = []
    for (scene, method, points), series in groupby(measurements, lambda m: (m.scene, m.method, m.points)):
        fitted = [
            (point.evaluations, point.error_rms)
            for point in series
            if point.error_rms is not None and point.error_rms > FLOOR * least[scene, points]
        ]
        order = None
        if len(fitted) > 1:
            evaluations, errors = np.log(np.array(fitted)).T
            order = -float(np.polyfit(evaluations, errors, 1)[0])
        found.append(Slope(scene=scene, method=method, points=points, order=order, fitted=len(fitted)))
    return found


def _reference(runs: Runs, plan: Plan, name: str, scene: Scene) -> tuple[Reference, Array]:
    method = plan.methods[0]
    (points, tolerance), control = plan.reference, plan.control
    finest = _with(scene, method, points, tolerance, plan.work_limit)
    run = runs.run(finest, f"{name}: converged run, N = {points}, tolerance {tolerance:g}")
    if run.outcome is Outcome.FAILED:
        raise ArithmeticError(f"{name}: the converged run failed: {run.failure}")
    membranes = final_membranes(run)
    second = runs.run(
        _with(scene, method, *control, plan.work_limit),
        f"{name}: control run, N = {control[0]}, tolerance {control[1]:g}",
    )
    reference = Reference(
        scene=name,
        points=points,
        tolerance=tolerance,
        uncertainty=position_error(second, membranes)[1],
        wall_seconds=run.work.wall_seconds,
        run_key=run_key(finest),
    )
    return reference, membranes


def _series(
    runs: Runs, plan: Plan, named: tuple[str, Scene], method: Method, points: int, membranes: Array
) -> list[Measurement]:
    """From the loosest tolerance to the tightest, or the first at which the run fails."""
    name, scene = named
    series: list[Measurement] = []
    for tolerance in plan.tolerances:
        tried = _with(scene, method, points, tolerance, plan.work_limit)
        run = runs.run(tried, f"{name}: {method.name}, N = {points}, tolerance {tolerance:g}")
        failed = run.outcome is Outcome.FAILED
        rms, largest = (None, None) if failed else position_error(run, membranes)
        series.append(
            Measurement(
                scene=name,
                method=method.name,
                points=points,
                tolerance=tolerance,
                error_rms=rms,
                error_max=largest,
                wall_seconds=run.work.wall_seconds,
                evaluations=run.work.rhs_evaluations,
                steps=run.work.steps,
                failure=run.failure,
                run_key=run_key(tried),
            )
        )
        if failed:
            break
    return series


def _with(scene: Scene, method: Method, points: int, tolerance: float, work_limit: int) -> Scene:
    return scene.model_copy(update={"numerics": method.at(points, tolerance, work_limit)})
