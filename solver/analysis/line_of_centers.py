"""The line of centers of two vesicles: its length, its angle, and the times of its half turns."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis.revolutions import RevolutionTracker, crossing

if TYPE_CHECKING:
    from solver.integrators import Step
    from solver.membrane.geometry import Membranes

Array = NDArray[np.float64]

# A pair may start beyond the separated distance.  Then it has to move farther apart by this factor.
_FARTHER = 1.5


class LineOfCenters(RevolutionTracker):
    """Follows the line of centers from step to step.

    Parameters
    ----------
    membranes : Membranes
    state : (state_size,)
        At the start.
    separated_distance : float
        Distance beyond which a pair that moves apart counts as separated.

    Attributes
    ----------
    distance : float
        At the end of the last step.
    separated : bool
        Whether the distance has passed the separated distance, or 1.5 times that at the start if that is
        more.
    separated_distance : float
        The one that counts.
    """

    direction_period = 2 * np.pi

    def __init__(self, membranes: Membranes, state: Array, separated_distance: float) -> None:
        super().__init__(membranes, state)
        self.distance = self.distance_of(state)
        self.separated_distance = max(separated_distance, _FARTHER * self.distance)
        self.separated = False

    def advance(self, step: Step) -> Step:
        """Follow one step, but no farther than to separation.

        Parameters
        ----------
        step : Step

        Returns
        -------
        Step
            The part that was followed.
        """
        if self.distance_of(step.state) >= self.separated_distance:
            self.separated = True
            step = step.until(crossing(step, lambda state: self.distance_of(state) - self.separated_distance))
        step = super().advance(step)
        self.distance = self.distance_of(step.state)
        return step

    def distance_of(self, state: Array) -> float:
        """Return the center distance in a state.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        float
        """
        return float(np.hypot(*self._offset(state)))

    def _direction(self, state: Array) -> float:
        offset = self._offset(state)
        return float(np.arctan2(offset[1], offset[0]))

    def _offset(self, state: Array) -> Array:
        first, second = self.membranes.curve_center(state)
        return np.asarray(second - first)
