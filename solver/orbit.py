"""The line of centers of two vesicles: its length, its angle, and when it has made each half turn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from solver.geometry import Membranes
from solver.integrators import Step

Array = NDArray[np.float64]

# A pair may start beyond the separated distance; then it has to move this much farther than its start.
_FARTHER = 1.5


class Orbit:
    """Follows the line of centers from step to step.

    Attributes
    ----------
    angle, distance : float
        At the end of the last step; the angle (radians) is unwrapped.
    separated : bool
        Whether the distance has passed the separated distance, or half as much again as at the start if that
        is farther.
    half_turns : list of float
        ``half_turns[k]`` is when the line had first turned by kπ from its start, either way.
    membranes : Membranes
        Those of the steps; others may take their place.
    """

    def __init__(self, membranes: Membranes, state: Array, separated_distance: float) -> None:
        self.membranes = membranes
        offset = self._offset(state)
        self.angle = self._start = float(np.arctan2(offset[1], offset[0]))
        self.distance = float(np.hypot(*offset))
        self._separated_distance = max(separated_distance, _FARTHER * self.distance)
        self.separated = False
        self.half_turns = [0.0]

    def advance(self, step: Step) -> Step:
        """Follow one step, but no farther than to separation; return the part followed."""
        if self.distance_of(step.state) >= self._separated_distance:
            self.separated = True
            step = step.until(
                self._crossing(step, lambda state: self.distance_of(state) - self._separated_distance)
            )
        distance = self.distance_of(step.state)
        angle = self.angle_of(step.state)
        while abs(angle - self._start) >= len(self.half_turns) * np.pi:
            self.half_turns.append(self._crossing(step, self._excess_turn))
        self.distance, self.angle = distance, angle
        return step

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
        first, second = self.membranes.curve_center(state)
        return np.asarray(second - first)

    def _excess_turn(self, state: Array) -> float:
        """How far the line has turned beyond the next half turn."""
        return abs(self.angle_of(state) - self._start) - len(self.half_turns) * np.pi

    @staticmethod
    def _crossing(step: Step, excess: Callable[[Array], float]) -> float:
        """When within a step the excess of a state becomes positive."""

        def excess_at(time: float) -> float:
            return excess(step.interpolate(time))

        if excess_at(step.start) >= 0:  # the interpolant may differ from the previous one by the tolerance
            return step.start
        return float(brentq(excess_at, step.start, step.end, xtol=1e-12 * max(step.end, 1.0)))
