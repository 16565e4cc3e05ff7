"""Step control: whether an attempted step is good enough, and how long the next one is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SAFETY = 0.9  # aimed at below what is allowed, as a factor of the step size
_SHRINK, _GROW = 0.2, 5.0  # limits of the change from one attempt to the next


def root_mean_square(values: Array) -> float:
    """The norm in which states are compared."""
    return float(np.sqrt(np.mean(values**2)))


@dataclass(frozen=True)
class Attempt:
    """A step that was tried.

    before, after : (state_size,), the states at its ends.
    estimate : (state_size,), the embedded estimate of the error of ``after``.
    interpolate : maps a fraction of the step, in [0, 1], to the state there.
    slope : the rate in ``after``, None where the method does not come to it.
    """

    size: float
    before: Array
    after: Array
    estimate: Array
    interpolate: Callable[[float], Array]
    slope: Array | None = None


@dataclass(frozen=True)
class StepDecision:
    """What becomes of an attempt: the size of the next one, and why this one is rejected, if it is."""

    size: float
    rejection: str | None = None


class StepControl(Protocol):
    """Chooses step sizes."""

    def first_size(self, acceleration: Array) -> float:
        """Size to begin with, given the second derivative of the state in time, (state_size,)."""

    def judge(self, attempt: Attempt) -> StepDecision:
        """Accept or reject a finite attempt."""

    def reject(self, size: float, reason: str) -> StepDecision:
        """Reject an attempt of this size that has no finite result."""


class ErrorMeasure(Protocol):
    """Compares the error of an attempt with what is allowed."""

    name: str  # of the error
    power: int  # the excess grows as this power of the step size

    def excess(self, attempt: Attempt) -> float:
        """Error as a multiple of what is allowed."""


class EmbeddedError:
    """The embedded estimate, which grows as ``power`` of the step size, against a tolerance on every step."""

    name = "estimated error"

    def __init__(self, tolerance: float, power: int) -> None:
        self.power = power
        self._tolerance = tolerance

    def excess(self, attempt: Attempt) -> float:
        """See `ErrorMeasure`."""
        return root_mean_square(attempt.estimate) / self._tolerance


class ConservedError:
    """The drift of conserved quantities against the step's share of a tolerance on the whole run.

    Quaife & Biros, Adaptive time stepping for vesicle suspensions, J. Comput. Phys. 306 (2016), with areas
    and lengths as the quantities.  Blind to errors that conserve them all; and where the discretization in
    space does not conserve them well enough, no step is small enough.

    Parameters
    ----------
    quantities : callable
        From a state (state_size,) to conserved quantities of order 1.
    tolerance : float
        Their drift over ``duration``.
    order : int
        Of the method.
    """

    name = "drift of areas and lengths"

    def __init__(
        self, quantities: Callable[[Array], Array], tolerance: float, duration: float, order: int
    ) -> None:
        self.power = order
        self._quantities = quantities
        self._allowed_rate = tolerance / duration

    def excess(self, attempt: Attempt) -> float:
        """See `ErrorMeasure`."""
        drift = np.abs(self._quantities(attempt.after) - self._quantities(attempt.before)).max()
        return float(drift) / (self._allowed_rate * attempt.size)


class AdaptiveStep:
    """Step sizes from a measured error that is allowed to be 1, with no growth right after a rejection.

    ``first_error`` (root mean square of the state) is what Euler's method would make in the first step.
    """

    def __init__(self, measure: ErrorMeasure, first_error: float) -> None:
        self._measure = measure
        self._first_error = first_error
        self._may_grow = True

    def first_size(self, acceleration: Array) -> float:
        """See `StepControl`."""
        typical = root_mean_square(acceleration)
        return float(np.sqrt(2 * self._first_error / typical)) if typical > 0 else np.inf

    def judge(self, attempt: Attempt) -> StepDecision:
        """See `StepControl`."""
        excess = self._measure.excess(attempt)
        if not np.isfinite(excess):
            return self.reject(attempt.size, f"the {self._measure.name} is not finite")
        factor = _SAFETY * excess ** (-1 / self._measure.power) if excess > 0 else _GROW
        if excess > 1:
            self._may_grow = False
            reason = f"the {self._measure.name} is {excess:.3g} times what is allowed"
            return StepDecision(attempt.size * max(factor, _SHRINK), reason)
        limit = _GROW if self._may_grow else 1.0
        self._may_grow = True
        return StepDecision(attempt.size * min(max(factor, _SHRINK), limit))

    def reject(self, size: float, reason: str) -> StepDecision:
        """See `StepControl`."""
        self._may_grow = False
        return StepDecision(size * _SHRINK, reason)
