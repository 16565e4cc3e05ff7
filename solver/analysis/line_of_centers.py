"""The line of centers of two vesicles: its length, its half turns, how far it opens, what turns with it."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis.revolutions import CountedDirection, RevolutionTracker, crossing, extremes
from solver.analysis.settling import KEPT_HALF_TURNS
from solver.membrane.inclination import inclination_by_angle

if TYPE_CHECKING:
    from solver.integrators import Step
    from solver.membrane.geometry import Membranes

Array = NDArray[np.float64]

# A pair may start beyond the separated distance.  Then it has to move farther apart by this factor.
_FARTHER = 1.5

_IN_A_TURN = 2  # half turns


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
    closest : list of float
        The smallest one, likewise.
    own_angles : list of (M,)
        Angles of the vesicles' long axes at the last passages, radians, unwrapped.
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
        "closest",
        "own_angles",
        "_opening",
        "_closest",
        "_own_angle",
    )

    def __init__(
        self, membranes: Membranes, state: Array, counted: CountedDirection, separated_distance: float
    ) -> None:
        super().__init__(membranes, state, counted)
        self._own_angle = self._own_directions(state)
        self.distance = self.distance_of(state)
        self.separated_distance = max(separated_distance, _FARTHER * self.distance)
        self.separated = False

    def count_from_here(self) -> None:
        """Count passages, and take openings, from the end of the last step on."""
        super().count_from_here()
        self.openings: list[float] = []
        self.closest: list[float] = []
        self.own_angles: list[Array] = []
        self._opening, self._closest = 0.0, math.inf  # in the half turn that has not ended

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
        self._follow_axes(step)
        return step

    @property
    def cycle(self) -> Array:
        """What characterizes each of the last half turns, (n, 2): logarithms of its duration and opening."""
        return np.column_stack([super().cycle, np.log(self.openings)])

    @property
    def opening(self) -> float | None:
        """Largest over smallest distance in the last full turn; None before the first one."""
        if len(self.openings) < _IN_A_TURN:
            return None
        return max(self.openings[-_IN_A_TURN:]) / min(self.closest[-_IN_A_TURN:])

    @property
    def own_turns(self) -> list[float] | None:
        """How often each long axis revolved in the last full turn, in its sense; None before the first."""
        if self.half_turns < _IN_A_TURN:
            return None
        turned = self.own_angles[-1] - self.own_angles[-1 - _IN_A_TURN]
        return list(self._counted.sense * turned / (2 * np.pi))

    def _follow_opening(self, step: Step) -> None:
        """Take in the distances of a step."""
        times = [step.start, *self.latest, step.end]
        known = self.count - len(self.latest)
        for index, (first, last) in enumerate(pairwise(times)):
            if index > 0:
                self._end_half_turn(known + index - 1)
            least, most = extremes(step, self.distance_of, first, last)
            self._opening, self._closest = max(self._opening, most), min(self._closest, least)

    def _end_half_turn(self, passage: int) -> None:
        if passage > 0:  # before the first passage there is no half turn
            self.openings = [*self.openings, self._opening][-KEPT_HALF_TURNS:]
            self.closest = [*self.closest, self._closest][-_IN_A_TURN:]
        self._opening, self._closest = 0.0, math.inf

    def _follow_axes(self, step: Step) -> None:
        """Unwrap the angles of the vesicles' long axes at times within a step, and keep those at passages."""
        angles = [self._own_angle]
        for state in self._states[1:]:
            angles.append(self._unwrapped_axes(state, angles[-1]))
        for time in self.latest:
            near = np.array([np.interp(time, self._times, own) for own in np.transpose(angles)])
            at_passage = self._unwrapped_axes(step.interpolate(time), near)
            self.own_angles = [*self.own_angles, at_passage][-_IN_A_TURN - 1 :]
        self._own_angle = angles[-1]

    def _unwrapped_axes(self, state: Array, near: Array) -> Array:
        angles = self._own_directions(state)
        return np.asarray(angles + np.pi * np.round((near - angles) / np.pi))

    def _own_directions(self, state: Array) -> Array:
        return inclination_by_angle(self.membranes.tangent_angle(state))

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
        coordinates = self.membranes.center_coordinates(state).tolist()
        if self.membranes.count == 1:  # the other vesicle is the image
            x, y = coordinates
            return [-2 * x, -2 * y]
        x, other_x, y, other_y = coordinates
        return [other_x - x, other_y - y]
