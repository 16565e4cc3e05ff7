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

_MOST = 1024  # values that are kept
# A spline depends on a value that lies so many others away by less than round-off: each of them at least
# halves the influence.
_FAR = 64
_MARKS = 3  # passages of a turn


class ViscosityHistory(Remembering):
    """The parts of the intrinsic viscosity at the ends of steps, from a step on that is of interest.

    They are measured where the step computed its last rate, if that is close to its end: this costs nothing.
    Steps are as short as the motion needs, so a cubic spline through these values is as accurate as the run.
    Of a long history only the last values are kept, and the integral up to them.

    Parameters
    ----------
    scene : Scene
        In shear.
    equation : EquationOfMotion
        Of this scene.
    """

    memory = ("_times", "_values", "_settled", "_integral", "_marks")

    def __init__(self, scene: Scene, equation: EquationOfMotion) -> None:
        self._scene = scene
        self._times: list[float] = []
        self._values: list[list[float]] = []
        self._settled = 0.0  # up to when the integral is known, whatever follows
        self._integral: Array | None = None  # up to then; None if nothing is left out
        self._marks: dict[float, Array | None] = {}  # integrals up to them, None while values tell
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

    def mark(self, time: float) -> None:
        """Note a time from or to which an average may be asked for; the last three are remembered.

        Parameters
        ----------
        time : float
            In the step that is followed next, or later.
        """
        self._marks[time] = None
        self._marks = dict(list(self._marks.items())[-_MARKS:])

    def follow(self, step: Step) -> None:
        """Take in a step, the first one with its start.

        Parameters
        ----------
        step : Step
        """
        if not self._times:
            self._take(step.start, step.interpolate(step.start))
            self._settled = float(step.start)
        self._take(step.end, step.state if step.evaluated is None else step.evaluated)
        if len(self._times) > _MOST:
            self._settle()

    def average(self, first: float, last: float) -> Viscosity | None:
        """Return the average over an interval.

        Parameters
        ----------
        first, last : float
            When it begins and ends: a time that was marked, or one in the last steps.  What was not followed
            is left out.

        Returns
        -------
        Viscosity or None
            None if nothing was followed in it.
        """
        if not self._times or first >= last:
            return None
        if self._integral is None:
            first = max(first, self._times[0])
            integral = self._between(first, last)
        else:
            integral = self._up_to(last) - self._up_to(first)
        parts = dict(zip(self._measures, (integral / (last - first)).tolist(), strict=True))
        return viscosity_of(parts)

    def _between(self, first: float, last: float) -> Array:
        return spline_integral(np.array(self._times), np.array(self._values), first, last)

    def _up_to(self, time: float) -> Array:
        """Return the integral from the first step that was followed up to a time."""
        known = self._marks.get(time)
        if known is not None:
            return known
        before = 0.0 if self._integral is None else self._integral
        return before + self._between(self._settled, time)

    def _settle(self) -> None:
        """Integrate up to a value that is far from the last one, and leave out what is far from that."""
        until = self._times[-_FAR]
        for time, integral in self._marks.items():
            if integral is None and time <= until:
                self._marks[time] = self._up_to(time)
        self._integral = self._up_to(until)
        self._settled = until
        del self._times[: -2 * _FAR], self._values[: -2 * _FAR]

    def _take(self, time: float, state: Array) -> None:
        motion = self._equation.motion(state)
        self._times.append(float(time))
        self._values.append([measure(motion) for measure in self._measures.values()])
