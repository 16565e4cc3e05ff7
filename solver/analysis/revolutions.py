"""The times at which a line in the plane has made its half turns."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from solver.membrane import curve

if TYPE_CHECKING:
    from solver.integrators import Step
    from solver.membrane.geometry import Membranes
    from solver.scene import Scene

Array = NDArray[np.float64]


class RevolutionTracker(ABC):
    """Follows the angle of a line from step to step.

    Parameters
    ----------
    membranes : Membranes
    state : (state_size,)
        At the start.

    Attributes
    ----------
    direction_period : float
        Rotation after which the line is the same: 2π, or π for a line without a head.
    angle : float
        At the end of the last step; radians, unwrapped.
    half_turns : list of float
        ``half_turns[k]`` is the time at which the line had first turned by kπ from its start, either way.
    membranes : Membranes
        Those of the steps.  Set it when the number of points changes.
    """

    direction_period: float

    def __init__(self, membranes: Membranes, state: Array) -> None:
        self.membranes = membranes
        self.angle = self._start = self._direction(state)
        self.half_turns = [0.0]

    @abstractmethod
    def _direction(self, state: Array) -> float:
        """Return the angle of the line, up to multiples of the period."""

    def advance(self, step: Step) -> Step:
        """Follow one step.

        Parameters
        ----------
        step : Step

        Returns
        -------
        Step
            The part that was followed.
        """
        angle = self.angle_of(step.state)
        while abs(angle - self._start) >= len(self.half_turns) * np.pi:
            self.half_turns.append(crossing(step, self._excess_turn))
        self.angle = angle
        return step

    def angle_of(self, state: Array) -> float:
        """Return the angle of the line in a state close to that of the last step.

        Parameters
        ----------
        state : (state_size,)
            Its angle differs from that of the last step by less than half the direction's period.

        Returns
        -------
        float
            Radians, unwrapped.
        """
        angle = self._direction(state)
        return angle + self.direction_period * round((self.angle - angle) / self.direction_period)

    @property
    def period(self) -> float | None:
        """Duration of the last full turn; None before the first one."""
        return self.half_turns[-1] - self.half_turns[-3] if len(self.half_turns) > 2 else None

    def _excess_turn(self, state: Array) -> float:
        """Return how far the line has turned beyond the next half turn, radians."""
        return abs(self.angle_of(state) - self._start) - len(self.half_turns) * np.pi


class LongAxisTracker(RevolutionTracker):
    """Follows the long principal axis of a single vesicle, a line without a direction."""

    direction_period = np.pi

    def _direction(self, state: Array) -> float:
        membranes = self.membranes
        angle, center = membranes.tangent_angle(state), membranes.center(state)
        return float(curve.inclination(curve.positions(angle, center, membranes.length))[0])


def may_tumble(scene: Scene) -> bool:
    """Return whether a scene is a single vesicle with a long axis, in a flow that rotates it.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    bool
    """
    flow = scene.imposed_flow
    rotates = flow is not None and flow.rotates
    return len(scene.vesicles) == 1 and rotates and scene.vesicles[0].reduced_area < 1


def crossing(step: Step, excess: Callable[[Array], float]) -> float:
    """Return the time within a step at which a function of the state becomes positive.

    Parameters
    ----------
    step : Step
    excess : callable
        From a state to a number that is positive at the end of the step.

    Returns
    -------
    float
    """

    def excess_at(time: float) -> float:
        return excess(step.interpolate(time))

    if excess_at(step.start) >= 0:  # the interpolant may differ from the previous one by the tolerance
        return step.start
    return float(brentq(excess_at, step.start, step.end, xtol=1e-12 * max(step.end, 1.0)))
