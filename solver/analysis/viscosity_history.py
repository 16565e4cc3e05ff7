"""The intrinsic viscosity against time, at the ends of steps: for averages that no recording changes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis.diagnostics import viscosity_measures
from solver.analysis.rheology import viscosity_of
from solver.analysis.spline import spline_integral
from solver.memory import Remembering

if TYPE_CHECKING:
    from solver.analysis.run import Viscosity
    from solver.integrators import Step
    from solver.motion.equation import EquationOfMotion
    from solver.scene import Scene

Array = NDArray[np.float64]


class ViscosityHistory(Remembering):
    """The parts of the intrinsic viscosity at the ends of steps, from a step on that is of interest.

    They are measured where the step computed its last rate, if that is close to its end: this costs nothing.
    Steps are as short as the motion needs, so a cubic spline through these values is as accurate as the run.

    Parameters
    ----------
    scene : Scene
        In shear.
    equation : EquationOfMotion
        Of this scene.
    """

    memory = ("_times", "_values")

    def __init__(self, scene: Scene, equation: EquationOfMotion) -> None:
        self._scene = scene
        self._times: list[float] = []
        self._values: list[list[float]] = []
        self.continue_with(equation)

    def continue_with(self, equation: EquationOfMotion) -> None:
        """Measure states with more points from now on.

        Parameters
        ----------
        equation : EquationOfMotion
            Of the same scene with more points.
        """
        self._equation = equation
        self._measures = viscosity_measures(self._scene, equation)

    def follow(self, step: Step) -> None:
        """Take in a step, the first one with its start.

        Parameters
        ----------
        step : Step
        """
        if not self._times:
            self._take(step.start, step.interpolate(step.start))
        self._take(step.end, step.state if step.evaluated is None else step.evaluated)

    def average(self, first: float, last: float) -> Viscosity | None:
        """Return the average over an interval.

        Parameters
        ----------
        first, last : float
            When it begins and ends; what was not followed is left out.

        Returns
        -------
        Viscosity or None
            None if nothing was followed in it.
        """
        if not self._times or first >= last:
            return None
        first = max(first, self._times[0])
        integral = spline_integral(np.array(self._times), np.array(self._values), first, last)
        parts = dict(zip(self._measures, (integral / (last - first)).tolist(), strict=True))
        return viscosity_of(parts)

    def _take(self, time: float, state: Array) -> None:
        motion = self._equation.motion(state)
        self._times.append(time)
        self._values.append([measure(motion) for measure in self._measures.values()])
