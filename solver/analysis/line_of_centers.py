"""The line of centers of two vesicles: its length, its angle, and when it has made each half turn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.analysis.revolutions import RevolutionTracker, crossing
from solver.integrators import Step
from solver.membrane.geometry import Membranes

Array = NDArray[np.float64]

# A pair may start beyond the separated distance; then it has to move this much farther than its start.
_FARTHER = 1.5


class LineOfCenters(RevolutionTracker):
    """Follows the line of centers from step to step.

    Attributes
    ----------
    distance : float
        At the end of the last step.
    separated : bool
        Whether the distance has passed the separated distance, or half as much again as at the start if that
        is farther.
    """

    ambiguity = 2 * np.pi

    def __init__(self, membranes: Membranes, state: Array, separated_distance: float) -> None:
        super().__init__(membranes, state)
        self.distance = self.distance_of(state)
        self._separated_distance = max(separated_distance, _FARTHER * self.distance)
        self.separated = False

    def advance(self, step: Step) -> Step:
        """Follow one step, but no farther than to separation; return the part followed."""
        if self.distance_of(step.state) >= self._separated_distance:
            self.separated = True
            step = step.until(
                crossing(step, lambda state: self.distance_of(state) - self._separated_distance)
            )
        step = super().advance(step)
        self.distance = self.distance_of(step.state)
        return step

    def distance_of(self, state: Array) -> float:
        """Center distance in a state."""
        return float(np.hypot(*self._offset(state)))

    def _direction(self, state: Array) -> float:
        offset = self._offset(state)
        return float(np.arctan2(offset[1], offset[0]))

    def _offset(self, state: Array) -> Array:
        first, second = self.membranes.curve_center(state)
        return np.asarray(second - first)
