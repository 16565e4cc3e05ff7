"""From a scene to a finished run."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis import averages
from solver.analysis.run import HOPELESS_SPATIAL, LARGEST_SPATIAL, Energy, Outcome, Run, Work
from solver.forces.tension import TensionNotFoundError
from solver.integrators import StepFailedError
from solver.membrane.geometry import Membranes
from solver.motion.terms import accurate_equation, equation_of_motion
from solver.parallel import SERIAL, Parallel, first_rank_asks
from solver.simulation.blas_threads import one_blas_thread
from solver.simulation.initial_state import initial_ellipses, rotated_state
from solver.simulation.moving_frame import MovingFrame
from solver.simulation.resolution import UnresolvedError, resolution_of, with_points
from solver.simulation.run_errors import errors_of
from solver.simulation.time_loop import TimeLoop
from solver.steady_states.rest import HiddenInstabilityError, rest_near
from solver.steady_states.steady_equations import SteadyEquations

if TYPE_CHECKING:
    from solver.scene import Scene
    from solver.steady_states.rest import Rest

Array = NDArray[np.float64]

# While a start relaxes, whatever the scene records: only its last state is kept.
_RELAXATION_OUTPUT = {"interval": 2.0, "frame_interval": 10.0}

_NUMERICAL_FAILURES = (
    StepFailedError,
    UnresolvedError,
    TensionNotFoundError,
    HiddenInstabilityError,
    np.linalg.LinAlgError,
)


class Cancelled(Exception):  # noqa: N818  the caller wants it, so it is no error
    """The caller asked the simulation to stop."""


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
        Called after every step, on the first rank only.  When it returns true, all ranks raise `Cancelled`.
    on_progress : callable, optional
        Called after every step with the time reached and the latest time at which the run ends, on each rank
        that gives one.

    Returns
    -------
    Run
        A numerical failure is an outcome (`Outcome.FAILED` with its reason), not an exception.

    Raises
    ------
    Cancelled
        If ``should_stop`` has returned true.
    """
    with one_blas_thread():
        began = clock.perf_counter()
        frame = MovingFrame.of_scene(scene)
        within = frame.scene if frame else scene
        resolution = resolution_of(within)
        start = _start(within, resolution.points, parallel, should_stop)
        should_stop = first_rank_asks(parallel, should_stop)
        require_time = _wall_limit(scene, parallel, began)
        equation_of = partial(equation_of_motion, parallel=parallel)
        # A circle has no other shape near: there is nothing to examine.
        has_circle = any(vesicle.is_circle for vesicle in scene.vesicles)
        examine = None if scene.many or has_circle else partial(_examined, within)
        placed = with_points(within, start.points)
        loop = TimeLoop(placed, start.state, resolution, equation_of, parallel, frame, examine)
        failure = None
        try:
            _begin(loop, start)
            while not loop.done:
                if not loop.advance():
                    continue
                if should_stop and should_stop():
                    raise Cancelled
                require_time(loop.time)
                if on_progress:
                    on_progress(loop.time, scene.latest_time)
            loop.recorder.finish(loop.time, loop.state)
        except _NUMERICAL_FAILURES as error:
            failure = _failure(loop, error)
        return _finished(scene, loop, failure, start.evaluations, clock.perf_counter() - began)


@dataclass(frozen=True)
class _Start:
    """The state to begin with, its number of points, what finding it cost, and why it could not be found."""

    points: int
    state: Array
    evaluations: int = 0
    failure: str | None = None


def _begin(loop: TimeLoop, start: _Start) -> None:
    """Record the start, and prepare the first step unless there is none."""
    loop.recorder.record(loop.time, loop.state)
    if start.failure:
        raise StepFailedError(start.failure)
    if loop.recorder.spatial_error > HOPELESS_SPATIAL:
        raise UnresolvedError("the run was not begun")
    loop.begin()


def _wall_limit(scene: Scene, parallel: Parallel, began: float) -> Callable[[float], None]:
    """Return what fails once the scene's wall limit is reached; it is given the time in the run."""
    limit = scene.numerics.wall_limit
    if limit is None:
        return lambda time: None
    reached = first_rank_asks(parallel, lambda: clock.perf_counter() - began > limit)

    def require_time(time: float) -> None:
        if reached and reached():
            raise StepFailedError(f"the wall limit of {limit:g} s is reached at time {time:g}")

    return require_time


def _start(scene: Scene, points: int, parallel: Parallel, should_stop: Callable[[], bool] | None) -> _Start:
    """Return where a run begins that needs this number of points for the vesicles as they are placed."""
    placed = initial_ellipses(with_points(scene, points))
    if not scene.start.relaxed:
        return _Start(points, placed)
    at_rest = scene.model_copy(
        update={
            "flow": None,
            "start": scene.start.model_copy(update={"relaxed": False}),
            "horizon": scene.start.horizon,
            "output": scene.output.model_copy(update=_RELAXATION_OUTPUT),
        }
    )
    relaxed = simulate(at_rest, parallel=parallel, should_stop=should_stop)
    evaluations = relaxed.work.rhs_evaluations
    if relaxed.outcome is not Outcome.EQUILIBRIUM:
        reason = relaxed.failure or f"{relaxed.outcome} at time {relaxed.time:g}"
        return _Start(points, placed, evaluations, f"start: the pair did not relax ({reason})")
    frames = relaxed.frames
    points = frames.tangent_angle.shape[-1]
    membranes = Membranes.of_scene(with_points(scene, points))
    computed = slice(membranes.count)  # the others are images
    last = membranes.pack(frames.tangent_angle[-1, computed], frames.center[-1, computed])
    return _Start(points, rotated_state(membranes, last, scene.start.tilt), evaluations)


def _examined(scene: Scene, membranes: Membranes, state: Array) -> Rest:
    """Find out what is behind a state that hardly changes; each rank does, with the same bits."""
    placed = with_points(scene, membranes.points)
    equations = SteadyEquations(accurate_equation(scene.vesicles, placed), placed)
    return rest_near(equations, membranes, state)


def _failure(loop: TimeLoop, error: Exception) -> str:
    """Return why a run failed, and see to it that at least its start is recorded."""
    recorder = loop.recorder
    if not recorder.samples:
        recorder.record_geometry(loop.time, loop.state)
    points, spatial = loop.segment.membranes.points, recorder.spatial_error
    if spatial > LARGEST_SPATIAL:
        return f"{error} ({points} points do not resolve the scene: spatial error {spatial:.1e})"
    return str(error)


def _finished(
    scene: Scene, loop: TimeLoop, failure: str | None, evaluations_before: int, wall_seconds: float
) -> Run:
    outcome = loop.outcome if failure is None else Outcome.FAILED
    series = loop.recorder.series
    flow = scene.imposed_flow
    rotates = flow is not None and flow.rotates
    period = loop.tracker.period if loop.tracker and rotates else None
    done = loop.segment.work
    return Run(
        scene=scene,
        outcome=outcome,
        failure=failure,
        undecided=loop.undecided if failure is None else None,
        time=loop.time,
        period=period,
        settled=loop.settled if period else None,
        effective_aspect_ratio=flow.effective_aspect_ratio(period) if flow and period else None,
        inclination_angle=averages.inclination(scene, series),
        gap=float(series["gap"][-1]) if "gap" in series else None,
        viscosity=averages.viscosity(scene, series, outcome, loop.tracker, loop.viscosities),
        energy=Energy(
            bending=float(series["bending_energy"][-1]),
            adhesion=float(series["adhesion_energy"][-1]) if "adhesion_energy" in series else None,
        ),
        error=errors_of(scene, loop, outcome),
        sensitive=loop.answer_errors.sensitive,
        work=Work(
            steps=loop.steps,
            rejected_steps=loop.rejected_steps,
            rhs_evaluations=evaluations_before + done.evaluations + done.recordings,
            jacobian_evaluations=done.jacobians,
            factorizations=done.factorizations,
            tension_iterations=done.tension_iterations,
            wall_seconds=wall_seconds,
            smallest_step=loop.smallest_step,
            points=loop.segment.membranes.points,
        ),
        series=series,
        frames=loop.recorder.frames,
        vesicle_series=loop.recorder.vesicle_series,
        perturbations=tuple(loop.perturbations),
    )
