"""Position errors against cost, over integrators, numbers of points and tolerances."""

from __future__ import annotations

import numpy as np

from ensemble.config.run_key import run_key
from ensemble.report.timed_runs import TimedRuns
from ensemble.report.work_precision.shape_distance import final_membranes, shape_distance
from ensemble.report.work_precision.work_precision_document import ConvergedRun, Measurement
from ensemble.report.work_precision.work_precision_plan import ComparedMethod, WorkPrecisionPlan
from solver.analysis.run import Array, Outcome, Run
from solver.scene import Scene


def position_error(run: Run, membranes: Array) -> tuple[float, float]:
    """Return how far the final membranes of a run are from converged ones.

    Parameters
    ----------
    run : Run
        The run.
    membranes : (vesicles, 2, points)
        Points of the converged membranes.

    Returns
    -------
    rms : float
        Root mean square of the distance, over all points of the run.
    largest : float
        Largest distance.
    """
    distances = np.concatenate(
        [shape_distance(points, other) for points, other in zip(final_membranes(run), membranes, strict=True)]
    )
    return float(np.sqrt(np.mean(distances**2))), float(distances.max())


def measure_scene(
    runs: TimedRuns, plan: WorkPrecisionPlan, name: str, scene: Scene
) -> tuple[ConvergedRun, list[Measurement]]:
    """Measure every method of a plan in one scene.

    Parameters
    ----------
    runs : TimedRuns
        Makes the runs.
    plan : WorkPrecisionPlan
        Methods, numbers of points and tolerances.
    name : str
        Name of the scene.
    scene : Scene
        It must end at its horizon, whatever happens in it.

    Returns
    -------
    converged : ConvergedRun
        The run from which errors are measured.
    measurements : list of Measurement
        One for each run.

    Raises
    ------
    ArithmeticError
        If the converged run fails.
    """
    converged, membranes = _converged(runs, plan, name, scene)
    measurements = []
    for method in plan.methods:
        for points in plan.points:
            measurements += _series(runs, plan, (name, scene), (method, points), membranes)
    return converged, measurements


def _converged(
    runs: TimedRuns, plan: WorkPrecisionPlan, name: str, scene: Scene
) -> tuple[ConvergedRun, Array]:
    method = plan.methods[0]
    (points, tolerance), control = plan.reference, plan.control
    finest = _with(scene, method, points, tolerance, plan.work_limit)
    run = runs.run(finest, f"{name}: converged run, N = {points}, tolerance {tolerance:g}")
    if run.outcome is Outcome.FAILED:
        raise ArithmeticError(f"{name}: the converged run failed: {run.failure}")
    membranes = final_membranes(run)
    coarser = runs.run(
        _with(scene, method, *control, plan.work_limit),
        f"{name}: control run, N = {control[0]}, tolerance {control[1]:g}",
    )
    converged = ConvergedRun(
        scene=name,
        points=points,
        tolerance=tolerance,
        uncertainty=position_error(coarser, membranes)[1],
        wall_seconds=run.work.wall_seconds,
        run_key=run_key(finest),
    )
    return converged, membranes


def _series(
    runs: TimedRuns,
    plan: WorkPrecisionPlan,
    named_scene: tuple[str, Scene],
    resolution: tuple[ComparedMethod, int],
    membranes: Array,
) -> list[Measurement]:
    """Measure from the loosest tolerance to the tightest, or to the first at which the run fails."""
    (name, scene), (method, points) = named_scene, resolution
    series: list[Measurement] = []
    for tolerance in plan.tolerances:
        measured = _with(scene, method, points, tolerance, plan.work_limit)
        run = runs.run(measured, f"{name}: {method.name}, N = {points}, tolerance {tolerance:g}")
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
                error_reported=run.error.global_,
                wall_seconds=run.work.wall_seconds,
                evaluations=run.work.rhs_evaluations,
                steps=run.work.steps,
                failure=run.failure,
                run_key=run_key(measured),
            )
        )
        if failed:
            break
    return series


def _with(scene: Scene, method: ComparedMethod, points: int, tolerance: float, work_limit: int) -> Scene:
    return scene.model_copy(update={"numerics": method.at(points, tolerance, work_limit)})
