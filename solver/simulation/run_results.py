"""The results of a run that has ended."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.analysis import averages
from solver.analysis.configurations import arrangement_of, configuration_of
from solver.analysis.free_energy import energy_of
from solver.analysis.line_of_centers import LineOfCenters
from solver.analysis.run import Outcome, RunResults, Work
from solver.simulation.run_errors import errors_of

if TYPE_CHECKING:
    from solver.scene import Scene
    from solver.simulation.time_loop import TimeLoop


def results_of(
    scene: Scene, loop: TimeLoop, failure: str | None, evaluations_before: int, wall_seconds: float
) -> RunResults:
    """Return what a run came to.

    Parameters
    ----------
    scene : Scene
    loop : TimeLoop
        After its last step.
    failure : str or None
        Why the run failed.
    evaluations_before : int
        Of the equation of motion, to find the start.
    wall_seconds : float
        That the run took.

    Returns
    -------
    RunResults
    """
    outcome = loop.outcome if failure is None else Outcome.FAILED
    sample = loop.recorder.sample
    flow = scene.imposed_flow
    # Under a rate that changes no turn is like the one before.
    rotates = flow is not None and flow.rotates and loop.time > scene.constant_from
    period = loop.tracker.period if loop.tracker and rotates else None
    viscosity = averages.viscosity(scene, sample, outcome, loop.tracker, loop.viscosities)
    done, membranes = loop.segment.work, loop.segment.membranes
    line = loop.tracker if isinstance(loop.tracker, LineOfCenters) else None
    arrangement = arrangement_of(scene, outcome, line, membranes, loop.state[: membranes.state_size])
    return RunResults(
        scene=scene,
        outcome=outcome,
        failure=failure,
        undecided=loop.undecided if failure is None else None,
        time=loop.time,
        period=period,
        settled=loop.settled if period else None,
        effective_aspect_ratio=flow.effective_aspect_ratio(period) if flow and period else None,
        inclination_angle=averages.inclination(scene, sample, loop.tracker),
        gap=sample.get("gap"),
        viscosity=viscosity,
        energy=energy_of(scene, outcome, sample),
        error=errors_of(scene, loop, outcome, viscosity),
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
            points=membranes.points,
        ),
        perturbations=tuple(loop.perturbations),
        configuration=configuration_of(arrangement),
        arrangement=arrangement,
    )
