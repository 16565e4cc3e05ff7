"""The times at which a line in the plane completes its half turns, and how long they take."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from solver.analysis.settling import KEPT_HALF_TURNS, has_settled
from solver.memory import Remembering
from solver.roots import root

if TYPE_CHECKING:
    from solver.flows import ImposedFlow
    from solver.integrators import Step
    from solver.membrane.geometry import Membranes
    from solver.memory import Saved

Array = NDArray[np.float64]

_NODES = np.cos(np.pi * np.arange(5) / 4).tolist()  # Chebyshev's, on [-1, 1]
_COEFFICIENTS = np.linalg.inv(np.vander(_NODES, increasing=True))  # of the polynomial through values at them
_ROUND_OFF = 1e-6  # half turns
_FOLLOWED = np.pi / 8  # turn of a tangent through which a line is followed at once, well below a quarter turn
# A line may be counted in this many directions, from that of the y axis on.
_DIRECTIONS = np.pi / 2 + np.linspace(0.0, np.pi, 180, endpoint=False)


class CountedDirection(NamedTuple):
    """The direction in which the half turns of a line are counted.

    Attributes
    ----------
    angle : float
        Of the direction and its opposite, radians.
    sense : int
        In which a line turns there: 1 for counterclockwise, -1 for clockwise.
    """

    angle: float
    sense: int


def counted_direction(flow: ImposedFlow | None) -> CountedDirection:
    """Return the direction in which a flow turns a line fastest, in shear that across the flow.

    A pair slides open and closes again while its line of centers passes the slow direction.  So between two
    passages of the fast one it does so once, and their times are well defined.

    Parameters
    ----------
    flow : ImposedFlow or None

    Returns
    -------
    CountedDirection
    """
    gradient = flow.velocity_gradient(np.zeros(2)) if flow else np.zeros((2, 2))
    along = np.stack([np.cos(_DIRECTIONS), np.sin(_DIRECTIONS)])
    rate = along[0] * (gradient[1] @ along) - along[1] * (gradient[0] @ along)
    fastest = int(np.argmax(np.abs(rate)))
    return CountedDirection(float(_DIRECTIONS[fastest]), 1 if rate[fastest] > 0 else -1)


class RevolutionTracker(Remembering, ABC):
    """Follows the angle of a line through every step.

    A direction says nothing of whole turns, and a step in a flow that rotates may be longer than one.  The
    tangent angles of a state do, so they say at how many times within a step the direction is taken.

    Parameters
    ----------
    membranes : Membranes
    state : (state_size,)
        At the start.
    counted : CountedDirection

    Attributes
    ----------
    direction_period : float
        Rotation after which the line is the same: 2π, or π for a line without a head.
    angle : float
        At the end of the last step; radians, unwrapped.
    passages : list of float
        Times at which the line first came to stand in the counted direction, or opposite to it, and then
        after each further half turn: the last ones, as many as anything is decided by.
    count : int
        Of all passages.
    latest : list of float
        Those in the last step.
    membranes : Membranes
        Those of the steps.  Set it when the number of points changes.
    """

    direction_period: float
    memory: ClassVar[tuple[str, ...]] = ("angle", "passages", "count", "_first")

    def __init__(self, membranes: Membranes, state: Array, counted: CountedDirection) -> None:
        self.membranes = membranes
        self._counted = counted
        self.angle = self._direction(state)
        self._stand()
        self.count_from_here()

    def restore(self, saved: Saved) -> None:
        """Remember what another one did; see `Remembering`.

        Parameters
        ----------
        saved : dict
        """
        super().restore(saved)
        self._stand()

    def _stand(self) -> None:
        """Take the angle as that of any time: no step has been followed."""
        self._times, self._angles = [0.0], [self.angle]
        self._states: list[Array] = []  # at these times

    def count_from_here(self) -> None:
        """Count passages from the end of the last step on: what was before is no part of the motion now."""
        # A start in the counted direction is no passage, whatever its round-off.
        self._first = np.floor(self._half_turns(self.angle) + _ROUND_OFF) + 1
        self.passages: list[float] = []
        self.latest: list[float] = []
        self.count = 0

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
        self._follow(step)
        self.latest = []
        while self._half_turns(self.angle) >= self._first + self.count:
            self.latest.append(crossing(step, self._beyond_next_passage))
            self.count += 1
        self.passages = [*self.passages, *self.latest][-KEPT_HALF_TURNS - 1 :]
        return step

    def angle_of(self, state: Array, time: float) -> float:
        """Return the angle of the line in a state close to that at a time within the last step.

        Parameters
        ----------
        state : (state_size,)
            Its angle differs from the one at that time by less than half the direction's period.
        time : float

        Returns
        -------
        float
            Radians, unwrapped.
        """
        return self._unwrapped(state, float(np.interp(time, self._times, self._angles)))

    @property
    def half_turns(self) -> int:
        """Number of half turns from one passage to the next."""
        return max(self.count - 1, 0)

    @property
    def last_turn(self) -> tuple[float, float] | None:
        """When the last full turn began and ended; None before the first one."""
        return (self.passages[-3], self.passages[-1]) if self.half_turns > 1 else None

    @property
    def period(self) -> float | None:
        """Duration of the last full turn; None before the first one."""
        return self.last_turn[1] - self.last_turn[0] if self.last_turn else None

    @property
    def cycle(self) -> Array:
        """What characterizes each of the last half turns, (n, quantities): the logarithm of its duration."""
        return np.log(np.diff(self.passages))[:, None]

    def has_settled(self, change: float) -> bool:
        """Return whether the half turns repeat themselves, and will.

        Parameters
        ----------
        change : float
            Largest relative change of what characterizes them.

        Returns
        -------
        bool
        """
        return has_settled(self.cycle, change)

    def _half_turns(self, angle: float) -> float:
        """Return how many half turns a line at an angle is beyond the counted direction."""
        return self._counted.sense * (angle - self._counted.angle) / np.pi

    def _beyond_next_passage(self, state: Array, time: float) -> float:
        return self._half_turns(self.angle_of(state, time)) - (self._first + self.count)

    def _follow(self, step: Step) -> None:
        """Unwrap the angle at times within a step between which no tangent turns far."""
        tangent_angle = self.membranes.tangent_angle
        times, angles, to_come = [step.start], [self.angle], [step.end]
        states = [step.interpolate(step.start)]
        tangents = tangent_angle(states[0])
        while to_come:
            time = to_come[-1]
            state = step.state if time == step.end else step.interpolate(time)
            turned = tangent_angle(state)
            if np.abs(turned - tangents).max() > _FOLLOWED:
                to_come.append(0.5 * (times[-1] + time))
                continue
            times.append(to_come.pop())
            angles.append(self._unwrapped(state, angles[-1]))
            states.append(state)
            tangents = turned
        self._times, self._angles, self._states = times, angles, states
        self.angle = angles[-1]

    def _unwrapped(self, state: Array, near: float) -> float:
        angle = self._direction(state)
        return angle + self.direction_period * round((near - angle) / self.direction_period)


def extremes(
    step: Step, quantity: Callable[[Array], float], first: float, last: float
) -> tuple[float, float]:
    """Return the minimum and the maximum of a smooth quantity over a part of a step.

    They are those of the polynomial of degree 4 through five values: no less accurate than the step.

    Parameters
    ----------
    step : Step
    quantity : callable
        From a state to a number.
    first, last : float
        Where the part begins and ends.

    Returns
    -------
    (float, float)
    """
    middle, half = 0.5 * (first + last), 0.5 * (last - first)
    values = [quantity(step.interpolate(middle + half * node)) for node in _NODES]
    least, most, ends = min(values), max(values), (values[0], values[-1])
    if least in ends and most in ends:
        return least, most
    polynomial = Polynomial(_COEFFICIENTS @ values)
    extremes = polynomial.deriv().roots()
    inside = polynomial(extremes[np.isreal(extremes) & (np.abs(extremes) < 1)].real).tolist()
    if least not in ends:
        least = min([least, *inside])
    if most not in ends:
        most = max([most, *inside])
    return least, most


def crossing(step: Step, excess: Callable[[Array, float], float]) -> float:
    """Return the time within a step at which a function of the state becomes positive.

    Parameters
    ----------
    step : Step
    excess : callable
        From a state and its time to a number that is positive at the end of the step.

    Returns
    -------
    float
    """

    def excess_at(time: float) -> float:
        return excess(step.interpolate(time), time)

    if excess_at(step.start) >= 0:  # the interpolant may differ from the previous one by the tolerance
        return step.start
    return root(excess_at, step.start, step.end, 1e-12 * max(step.end, 1.0))
