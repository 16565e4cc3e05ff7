"""The errors of a run that has ended."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis.answer_errors import change_of
from solver.analysis.averages import is_at_rest, pair_inclination, revolves
from solver.analysis.diagnostics import measures
from solver.analysis.run import Errors, Outcome, Viscosity
from solver.analysis.state_error import magnitude, position_error

if TYPE_CHECKING:
    from solver.scene import Scene
    from solver.simulation.time_loop import TimeLoop

Array = NDArray[np.float64]


def errors_of(scene: Scene, loop: TimeLoop, outcome: Outcome, viscosity: Viscosity | None) -> Errors:
    """Return the errors of a run and of its answers.

    Parameters
    ----------
    scene : Scene
    loop : TimeLoop
        After its last step.
    outcome : Outcome
    viscosity : Viscosity or None
        Of the run.

    Returns
    -------
    Errors
    """
    recorder = loop.recorder
    of_answers: dict[str, float | None] = {}
    if loop.error is not None and outcome is not Outcome.FAILED:
        temporal = position_error(loop.segment.membranes, loop.state, loop.error)
        of_positions = float(np.hypot(temporal, recorder.spatial_position_error))
        of_answers["global_"] = _unless_larger(of_positions, min(v.length for v in scene.vesicles))
        of_answers["inclination_angle"] = _inclination_error(scene, loop, loop.error)
        if viscosity is not None:
            error = _viscosity_error(scene, loop, loop.error, outcome)
            of_answers["viscosity"] = _unless_larger(error, viscosity.total)
        if loop.tracker and scene.flow and scene.flow.rotates and loop.time > scene.constant_from:
            of_answers["period"] = _unless_larger(loop.answer_errors.period, loop.tracker.period)
        of_answers["time"] = _unless_larger(loop.answer_errors.separation, loop.time)
    return Errors(
        area=recorder.largest["area_error"],
        closure=recorder.largest["closure_error"],
        temporal=loop.temporal_error,
        spatial=recorder.spatial_error,
        **of_answers,
    )


def _unless_larger(error: float | None, answer: float | None) -> float | None:
    """Return an error to first order; None if it is larger than its answer, of which it says nothing then."""
    return error if error is not None and answer is not None and error <= abs(answer) else None


def _inclination_error(scene: Scene, loop: TimeLoop, error: Array) -> float | None:
    """Return that of `averages.inclination`, in degrees."""
    tracker = loop.tracker
    if tracker is None or scene.flow is None:
        return None
    one = len(scene.vesicles) == 1
    if not one and (not scene.flow.strains or revolves(scene, tracker)):
        return None

    def angle(state: Array) -> float:
        radians = tracker.angle_of(state, loop.time)
        return float(np.degrees(radians) if one else pair_inclination(np.array(radians)))

    return magnitude(change_of(angle, loop.state, error))


def _viscosity_error(scene: Scene, loop: TimeLoop, error: Array, outcome: Outcome) -> float | None:
    """Return that of the total viscosity: of the average over the last turn, or of the steady value."""
    equation = loop.segment.equation
    parts = [measure for name, measure in measures(scene, equation).items() if name.startswith("viscosity")]
    if not parts:
        return None

    def total(state: Array) -> float:
        motion = equation.motion(state)
        return sum(part(motion) for part in parts)

    if is_at_rest(scene, outcome, loop.tracker):
        return magnitude(change_of(total, loop.state, error))
    return loop.answer_errors.of_average(total)
