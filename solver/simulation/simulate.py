"""The time loop: from a scene to a finished run."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.analysis import averages
from solver.analysis.diagnostics import Recorder
from solver.analysis.line_of_centers import LineOfCenters
from solver.analysis.outcome import History, criteria_of, latest_time, may_tumble
from solver.analysis.revolutions import LongAxisTracker, RevolutionTracker
from solver.analysis.run import LARGEST_SPATIAL, Energy, Errors, Outcome, Run, Work
from solver.forces.tension import TensionNotFoundError
from solver.integrators import Step, StepFailedError
from solver.membrane.geometry import Membranes
from solver.parallel import SERIAL, Parallel, first_rank_asks, require_agreement
from solver.scene import Output, Scene, Start
from solver.simulation.initial_state import initial_ellipses, rotated_state
from solver.simulation.resolution import UnresolvedError, carried, resolution_of, with_points
from solver.simulation.segment import Segment, SegmentWork

Array = NDArray[np.float64]

# While a start relaxes, whatever the scene records: when the relaxation ends depends on when it is sampled.
_RELAXATION_OUTPUT = Output(interval=2.0, frame_interval=10.0)


class Cancelled(Exception):  # noqa: N818  an outcome of the caller's own wish, not an error
    """The caller asked the simulation to stop."""


@dataclass
class _Progress:
    """What the loop has come to."""

    time: float
    state: Array
    steps: int = 0
    rejected: int = 0
    smallest_step: float | None = None
    temporal_error: float = 0.0


def simulate(
    scene: Scene,
    *,
    parallel: Parallel = SERIAL,
    should_stop: Callable[[], bool] | None = None,
    on_progress: Callable[[float, float], None] | None = None,
) -> Run:
    """Run a scene until its outcome is decided.

    Collective: all ranks of ``parallel`` call it with the same scene and return the same run.

    Parameters
    ----------
    scene : Scene
    parallel : Parallel
        The ranks that compute the run together.
    should_stop : callable, optional
        Asked after every step, on the first rank alone; `Cancelled` is raised on all once it returns true.
    on_progress : callable, optional
        Told the time reached and the latest time after every step, on each rank that gives one.

    Returns
    -------
    Run
        A numerical failure is an outcome (`Outcome.FAILED` with its reason), not an exception.
    """
    began = clock.perf_counter()
    resolution = resolution_of(scene)
    start = _start(scene, resolution.points, parallel, should_stop)
    should_stop = first_rank_asks(parallel, should_stop)
    latest = latest_time(scene)
    stage = Segment(with_points(scene, start.points), SegmentWork(), parallel)
    orbit = None
    if len(scene.vesicles) == 2:
        orbit = LineOfCenters(stage.membranes, start.state, scene.criteria.separated_distance)
    axis = LongAxisTracker(stage.membranes, start.state) if may_tumble(scene) else None
    turns: RevolutionTracker | None = orbit or axis
    recorder = Recorder(scene, stage.dynamics, orbit)
    criteria = criteria_of(scene)
    progress = _Progress(0.0, start.state)
    outcome, failure = Outcome.UNDECIDED, None
    try:
        recorder.record(0.0, start.state)
        if start.failure:
            raise StepFailedError(start.failure)
        stage.begin(0.0, start.state, latest)
        while progress.time < latest and outcome is Outcome.UNDECIDED:
            step = stage.step()
            require_agreement(parallel, step.end)
            points = resolution.finer(stage.membranes, step.end, step.state)
            if points is not None:
                coarse, stage = stage.membranes, Segment(with_points(scene, points), stage.cost, parallel)
                progress.state = carried(coarse, progress.state, stage.membranes)
                progress.rejected += 1
                recorder.continue_with(stage.dynamics)
                if turns:
                    turns.membranes = stage.membranes
                stage.begin(progress.time, progress.state, latest)
                continue
            if step.end < latest or progress.smallest_step is None:  # the last one ends where the run does
                taken = float(step.end - step.start)
                progress.smallest_step = min(progress.smallest_step or taken, taken)
            if turns:
                step = turns.advance(step)
            _record_during(step, recorder, scene.output.interval)
            progress.time, progress.state = step.end, step.state
            progress.steps += 1
            progress.rejected += step.shortened
            progress.temporal_error += step.local_error
            history = History(recorder.values, stage.dynamics, orbit, step.state, axis)
            decisions = (criterion.decide(history) for criterion in criteria)
            outcome = next((decision for decision in decisions if decision), Outcome.UNDECIDED)
            if stage.cost.evaluations > scene.numerics.work_limit:
                raise StepFailedError(f"the work limit of {scene.numerics.work_limit} evaluations is reached")
            if should_stop and should_stop():
                raise Cancelled
            if on_progress:
                on_progress(step.end, latest)
        recorder.finish(progress.time, progress.state)
    except (StepFailedError, UnresolvedError, TensionNotFoundError, np.linalg.LinAlgError) as error:
        outcome, failure = Outcome.FAILED, str(error)
        if recorder.spatial_error > LARGEST_SPATIAL:
            points, spatial = stage.membranes.points, recorder.spatial_error
            failure += f" ({points} points do not resolve the scene: spatial error {spatial:.1e})"
    work = Work(
        steps=progress.steps,
        rejected_steps=progress.rejected,
        rhs_evaluations=start.evaluations + stage.cost.evaluations + stage.cost.recordings,
        jacobian_evaluations=stage.cost.jacobians,
        factorizations=stage.cost.factorizations,
        tension_iterations=stage.cost.tension_iterations,
        wall_seconds=clock.perf_counter() - began,
        smallest_step=progress.smallest_step,
        points=stage.membranes.points,
    )
    return _summary(scene, outcome, failure, progress, turns, recorder, work)


@dataclass(frozen=True)
class _Start:
    """The state to begin with, its number of points, what finding it cost, and why it could not be found."""

    points: int
    state: Array
    evaluations: int = 0
    failure: str | None = None


def _start(scene: Scene, points: int, parallel: Parallel, should_stop: Callable[[], bool] | None) -> _Start:
    """Where a run begins that needs these points for the vesicles as they are placed."""
    placed = initial_ellipses(with_points(scene, points))
    if not scene.start.relaxed:
        return _Start(points, placed)
    at_rest = scene.model_copy(
        update={
            "flow": None,
            "start": Start(),
            "horizon": scene.start.horizon,
            "output": _RELAXATION_OUTPUT,
        }
    )
    relaxed = simulate(at_rest, parallel=parallel, should_stop=should_stop)
    if relaxed.outcome is not Outcome.EQUILIBRIUM:
        reason = relaxed.failure or f"{relaxed.outcome} at time {relaxed.time:g}"
        evaluations = relaxed.work.rhs_evaluations
        return _Start(points, placed, evaluations, f"start: the pair did not relax ({reason})")
    frames = relaxed.frames
    points = frames.tangent_angle.shape[-1]
    membranes = Membranes.of_scene(with_points(scene, points))
    computed = slice(membranes.count)  # the others are images
    last = membranes.pack(frames.tangent_angle[-1, computed], frames.center[-1, computed])
    turned = rotated_state(membranes, last, scene.start.tilt)
    return _Start(points, turned, relaxed.work.rhs_evaluations)


def _record_during(step: Step, recorder: Recorder, interval: float) -> None:
    """Record all multiples of ``interval`` that the last step has passed."""
    recorded = round(recorder.values["time"][-1] / interval)
    for index in range(recorded + 1, int(np.floor(step.end / interval)) + 1):
        time = index * interval
        # At its end the interpolant differs from the state by round-off.
        recorder.record(time, step.state if time == step.end else step.interpolate(time))


def _summary(
    scene: Scene,
    outcome: Outcome,
    failure: str | None,
    progress: _Progress,
    turns: RevolutionTracker | None,
    recorder: Recorder,
    work: Work,
) -> Run:
    series = recorder.series
    period = turns.period if turns and scene.flow and scene.flow.rotates else None
    adhesion_energy = series.get("adhesion_energy")
    return Run(
        scene=scene,
        outcome=outcome,
        failure=failure,
        time=progress.time,
        period=period,
        effective_aspect_ratio=scene.flow.effective_aspect_ratio(period) if scene.flow and period else None,
        inclination_angle=averages.inclination(scene, series),
        gap=float(series["gap"][-1]) if "gap" in series else None,
        viscosity=averages.viscosity(scene, series, outcome, turns),
        energy=Energy(
            bending=float(series["bending_energy"][-1]),
            adhesion=None if adhesion_energy is None else float(adhesion_energy[-1]),
        ),
        error=Errors(
            area=float(series["area_error"].max()),
            closure=float(series["closure_error"].max()),
            temporal=progress.temporal_error,
            spatial=recorder.spatial_error,
        ),
        work=work,
        series=series,
        frames=recorder.frames,
        vesicle_series=recorder.vesicle_series,
    )
