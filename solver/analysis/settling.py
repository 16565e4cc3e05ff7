"""Whether a motion has settled: whether half turns repeat themselves, and how fast a state still changes."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from solver.membrane.geometry import Membranes

Array = NDArray[np.float64]

# Half turns after which a motion may repeat itself: one, or two where they alternate.
_CYCLES = (1, 2)
_COMPARED = 3  # cycles
KEPT_HALF_TURNS = _COMPARED * max(_CYCLES)  # that decide whether a motion has settled
# Changes below this fraction of the tolerance may be those of the numerical error, which do not shrink.
_NEGLIGIBLE = 0.1
# A change above this multiple of the tolerance may be followed by a small one by chance.  Below it, motion
# near an unstable cycle is nearly linear, so that a change that shrinks proves the cycle stable.
_LINEAR = 5.0


class Convergence(NamedTuple):
    """How a sequence converges to one that repeats itself.

    Attributes
    ----------
    change : float
        Largest difference between its last cycle and the one before.
    before : float
        The same one cycle earlier.
    """

    change: float
    before: float

    @property
    def remaining(self) -> float:
        """Sum of all differences to come if they go on to shrink as they did; infinite if they did not."""
        shrunk = self.before - self.change
        return self.change**2 / shrunk if shrunk > 0 else np.inf

    def within(self, tolerance: float) -> bool:
        """Return whether the sequence repeats itself within a tolerance, and will.

        Parameters
        ----------
        tolerance : float

        Returns
        -------
        bool
        """
        if max(self.change, self.before) <= _NEGLIGIBLE * tolerance:
            return True
        return self.before <= _LINEAR * tolerance and max(self.change, self.remaining) <= tolerance


def convergence(half_turns: Array) -> list[Convergence]:
    """Measure how a sequence of half turns converges.

    Parameters
    ----------
    half_turns : (n, quantities)
        What characterizes each half turn, as logarithms: differences are relative changes.

    Returns
    -------
    list of Convergence
        To a motion that repeats itself after each half turn, and to one that does so after every other one,
        as far as there are three cycles to compare.
    """
    found = []
    for cycle in _CYCLES:
        if len(half_turns) >= _COMPARED * cycle:
            compared = half_turns[-_COMPARED * cycle :].reshape(_COMPARED, cycle, -1)
            earlier, previous, last = compared
            change, before = np.abs(last - previous).max(), np.abs(previous - earlier).max()
            found.append(Convergence(float(change), float(before)))
    return found


def has_settled(half_turns: Array, tolerance: float) -> bool:
    """Return whether a motion repeats itself, and will.

    Parameters
    ----------
    half_turns : (n, quantities)
        As for `convergence`.
    tolerance : float
        Largest relative change from one cycle to the next, and of all that follow together.

    Returns
    -------
    bool
    """
    return any(found.within(tolerance) for found in convergence(half_turns))


def state_rate(membranes: Membranes, change: Array, duration: float) -> float:
    """Return the largest rate at which a tangent angle, or a center relative to their mean, changed.

    It is zero when shapes and arrangement stay.  Treading does not count, since the points move along the
    membranes such that tangent angles stay.

    Parameters
    ----------
    membranes : Membranes
    change : (state_size,)
        Difference of two states.
    duration : float
        Time between them.

    Returns
    -------
    float
        Radians, or lengths, over time.
    """
    angles, centers = membranes.tangent_angle(change), membranes.curve_center(change)
    relative = centers - centers.mean(axis=0)
    return float(max(np.abs(angles).max(), np.abs(relative).max()) / duration)
