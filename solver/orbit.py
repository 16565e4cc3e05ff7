"""The line of centers of two vesicles: its length, its angle, and when it has made each half turn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from solver.geometry import Membranes
from solver.integrators import Step

Array = NDArray[np.float64]


class Orbit:
    """Follows the line of centers from step to step.

    Attributes
    ----------
    angle, distance : float
        At the end of the last step; the angle (radians) is unwrapped.
    outward : bool
        Whether the distance grew during the last step.
    half_turns : list of float
        ``half_turns[k]`` is when the line had first turned by kπ from its start, either way.
    """

    def __init__(self, membranes: Membranes, state: Array) -> None:
        self._membranes = membranes
        offset = self._offset(state)
        self.angle = self._start = float(np.arctan2(offset[1], offset[0]))
        self.distance = float(np.hypot(*offset))
        self.outward = False
        self.half_turns = [0.0]

    def advance(self, step: Step) -> None:
        """Follow one step."""
        distance = self.distance_of(step.state)
        angle = self.angle_of(step.state)
        while abs(angle - self._start) >= len(self.half_turns) * np.pi:
            self.half_turns.append(self._crossing(step, len(self.half_turns) * np.pi))
        self.outward = distance > self.distance
        self.distance, self.angle = distance, angle

    def distance_of(self, state: Array) -> float:
        """Center distance in a state."""
        return float(np.hypot(*self._offset(state)))

    def angle_of(self, state: Array) -> float:
        """Angle of the line of centers in a state less than half a turn from the last step's."""
        offset = self._offset(state)
        angle = float(np.arctan2(offset[1], offset[0]))
        return angle + 2 * np.pi * round((self.angle - angle) / (2 * np.pi))

    @property
    def period(self) -> float | None:
        """Duration of the last full turn, None before there is one."""
        return self.half_turns[-1] - self.half_turns[-3] if len(self.half_turns) > 2 else None

    def _offset(self, state: Array) -> Array:
        first, second = self._membranes.center(state)
        return np.asarray(second - first)

    def _crossing(self, step: Step, turn: float) -> float:
        def excess(time: float) -> float:
            return abs(self.angle_of(step.interpolate(time)) - self._start) - turn

        if excess(step.start) >= 0:  # the interpolant may differ from the previous one by the tolerance
            return step.start
        return float(brentq(excess, step.start, step.end, xtol=1e-12 * max(step.end, 1.0)))
