"""The part of a run that has one number of points."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from solver.integrators import InitialValueProblem, Integrator, Step, integrator_for

if TYPE_CHECKING:
    from solver.membrane.geometry import Membranes
    from solver.memory import Saved
    from solver.motion.equation import EquationOfMotion
    from solver.scene import Scene

Array = NDArray[np.float64]


class SegmentWork(NamedTuple):
    """What a run has cost so far.

    Attributes
    ----------
    evaluations : int
        Of the equation of motion, for steps.
    recordings : int
        Of the equation of motion, for diagnostics and frames alone.
    jacobians, factorizations, tension_iterations : int
    """

    evaluations: int = 0
    recordings: int = 0
    jacobians: int = 0
    factorizations: int = 0
    tension_iterations: int = 0


class Segment:
    """The part of a run that has one number of points.

    Parameters
    ----------
    equation : EquationOfMotion
        With that number of points.
    scene : Scene
    before : SegmentWork
        Of the parts before this one.
    """

    def __init__(self, equation: EquationOfMotion, scene: Scene, before: SegmentWork) -> None:
        self.equation = equation
        self._scene = scene
        self._before = before
        self._problem: InitialValueProblem | None = None
        self._integrator: Integrator | None = None

    @property
    def membranes(self) -> Membranes:
        """What stays the same in this part."""
        return self.equation.membranes

    def begin(self, time: float, state: Array, latest: float, error: Array | None) -> None:
        """Make the integrator for the steps from a state on.

        Parameters
        ----------
        time : float
        state : (state_size,)
            At this time.
        latest : float
            When the last step ends.
        error : (state_size,) or None
            Estimated error of the state; None for an exact one.
        """
        self._problem = problem = InitialValueProblem(self.equation, state, time, latest, error)
        self._integrator = integrator_for(problem, self._scene.numerics, len(self._scene.vesicles))

    def saved(self) -> Saved:
        """Return what decides the steps to come; `begin` comes before.

        Returns
        -------
        dict
            See `solver.memory`.
        """
        problem, integrator = self._problem, self._integrator
        assert problem
        assert integrator
        return {
            "points": self.membranes.points,
            "before": tuple(self._before),
            "begun": (problem.start, problem.state.copy(), problem.end, problem.error),
            "integrator": integrator.saved(),
            "equation": self.equation.saved(),
        }

    @classmethod
    def restored(cls, saved: Saved, equation: EquationOfMotion, scene: Scene) -> Self:
        """Go on with a part that was saved.

        Parameters
        ----------
        saved : dict
        equation : EquationOfMotion
            With its number of points.
        scene : Scene

        Returns
        -------
        Segment
        """
        segment = cls(equation, scene, SegmentWork(*saved["before"]))
        # Where it began the integrator is known to find what it needs; it forgets that at once.
        segment.begin(*saved["begun"])
        assert segment._integrator
        segment._integrator.restore(saved["integrator"])
        equation.restore(saved["equation"])
        return segment

    def step(self) -> Step:
        """Take one step; `begin` comes before.

        Returns
        -------
        Step

        Raises
        ------
        StepFailedError
            If no step is possible.
        """
        assert self._integrator
        return self._integrator.step()

    @property
    def work(self) -> SegmentWork:
        """What the run has cost up to now, the parts before this one included."""
        integrator = self._integrator
        return SegmentWork(
            self._before.evaluations + self.equation.evaluations,
            self._before.recordings + self.equation.recordings,
            self._before.jacobians + (integrator.jacobian_evaluations if integrator else 0),
            self._before.factorizations + (integrator.factorizations if integrator else 0),
            self._before.tension_iterations + self.equation.tension_iterations,
        )
