"""The line of centers of two vesicles: its length, its half turns, and how far it opens in each."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis.revolutions import CountedDirection, RevolutionTracker, crossing, greatest
from solver.analysis.settling import KEPT_HALF_TURNS

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
    counted : CountedDirection
    separated_distance : float
        Distance beyond which a pair that moves apart counts as separated.

    Attributes
    ----------
    distance : float
        At the end of the last step.
    openings : list of float
        The largest distance in each of the last half turns from one passage to the next, continuous in time.
    separated : bool
        Whether the distance has passed the separated distance, or 1.5 times that at the start if that is
        more.
    separated_distance : float
        The one that counts.
    """

    direction_period = 2 * np.pi
    memory = (
        *RevolutionTracker.memory,
        "distance",
        "separated_distance",
        "separated",
        "openings",
        "_opening",
    )

    def __init__(
        self, membranes: Membranes, state: Array, counted: CountedDirection, separated_distance: float
    ) -> None:
        super().__init__(membranes, state, counted)
        self.distance = self.distance_of(state)
        self.separated_distance = max(separated_distance, _FARTHER * self.distance)
        self.separated = False

    def count_from_here(self) -> None:
        """Count passages, and take openings, from the end of the last step on."""
        super().count_from_here()
        self.openings: list[float] = []
        self._opening = 0.0  # in the half turn that has not ended

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
            step = step.until(crossing(step, self._beyond_separation))
        step = super().advance(step)
        self.distance = self.distance_of(step.state)
        self._follow_opening(step)
        return step

    @property
    def cycle(self) -> Array:
        """What characterizes each of the last half turns, (n, 2): logarithms of its duration and opening."""
        return np.column_stack([super().cycle, np.log(self.openings)])

    def _follow_opening(self, step: Step) -> None:
        """Take in the distances of a step."""
        times = [step.start, *self.latest, step.end]
        known = self.count - len(self.latest)
        for index, (first, last) in enumerate(pairwise(times)):
            if index > 0:
                self._end_half_turn(known + index - 1)
            self._opening = max(self._opening, greatest(step, self.distance_of, first, last))

    def _end_half_turn(self, passage: int) -> None:
        if passage > 0:  # before the first passage there is no half turn
            self.openings = [*self.openings, self._opening][-KEPT_HALF_TURNS:]
        self._opening = 0.0

    def distance_of(self, state: Array) -> float:
        """Return the center distance in a state.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        float
        """
        return math.hypot(*self._offset(state))

    def _beyond_separation(self, state: Array, time: float) -> float:
        return self.distance_of(state) - self.separated_distance

    def _direction(self, state: Array) -> float:
        x, y = self._offset(state)
        return math.atan2(y, x)

    def _offset(self, state: Array) -> list[float]:
        x, y = self.membranes.center(state).T.tolist()
        if len(x) == 1:  # the other vesicle is the image
            return [-2 * x[0], -2 * y[0]]
        return [x[1] - x[0], y[1] - y[0]]
