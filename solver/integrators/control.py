"""Step control: whether an attempted step is good enough, and how long the next one is."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from solver.memory import Remembering

Array = NDArray[np.float64]

_SAFETY = 0.9  # factor of the step size that keeps the next error below what is allowed
_SHRINK, _GROW = 0.2, 5.0  # limits of the factor from one attempt to the next


def root_mean_square(values: Array) -> float:
    """Return the norm in which states are compared.

    Parameters
    ----------
    values : (n,)

    Returns
    -------
    float
    """
    return math.sqrt(values @ values / values.size)


@dataclass(frozen=True)
class Attempt:
    """A step that was tried.

    Attributes
    ----------
    size : float
        Its duration.
    before, after : (n,)
        States at its ends.
    estimate : (n,)
        Embedded estimate of the error of ``after``.
    interpolate : callable
        From a fraction of the step, in [0, 1], to the state there.
    slope : (n,) or None
        Rate in ``after``; None if the method does not compute it.
    """

    size: float
    before: Array
    after: Array
    estimate: Array
    interpolate: Callable[[float], Array]
    slope: Array | None = None


@dataclass(frozen=True)
class StepDecision:
    """Whether an attempt is accepted, and how long the next one is.

    Attributes
    ----------
    size : float
        Duration of the next attempt.
    rejection : str or None
        Why this one is rejected; None if it is accepted.
    """

    size: float
    rejection: str | None = None


class StepControl(Protocol):
    """Chooses step sizes."""

    def first_size(self, acceleration: Array) -> float:
        """Return the size of the first attempt.

        Parameters
        ----------
        acceleration : (n,)
            Second derivative of the state in time.

        Returns
        -------
        float
        """

    def judge(self, attempt: Attempt) -> StepDecision:
        """Accept or reject a finite attempt.

        Parameters
        ----------
        attempt : Attempt

        Returns
        -------
        StepDecision
        """

    def reject(self, size: float, reason: str) -> StepDecision:
        """Reject an attempt that has no finite result.

        Parameters
        ----------
        size : float
            Of the attempt.
        reason : str

        Returns
        -------
        StepDecision
        """


class ErrorMeasure(Protocol):
    """Compares the error of an attempt with what is allowed.

    Attributes
    ----------
    name : str
        Of the error, for messages.
    power : int
        The excess grows as this power of the step size.
    """

    name: str
    power: int

    def excess(self, attempt: Attempt) -> float:
        """Return the error as a multiple of what is allowed.

        Parameters
        ----------
        attempt : Attempt

        Returns
        -------
        float
        """


class EmbeddedError:
    """Compares the embedded estimate with a tolerance on every step.

    Parameters
    ----------
    tolerance : float
    power : int
        The estimate grows as this power of the step size.
    """

    name = "estimated error"

    def __init__(self, tolerance: float, power: int) -> None:
        self.power = power
        self._tolerance = tolerance

    def excess(self, attempt: Attempt) -> float:
        """Return the estimate over the tolerance.

        Parameters
        ----------
        attempt : Attempt

        Returns
        -------
        float
        """
        return root_mean_square(attempt.estimate) / self._tolerance


class ConservedError:
    """Compares the drift of conserved quantities with the step's share of a tolerance on the whole run.

    Areas and lengths are the quantities in (Quaife & Biros 2016).  Errors that conserve them all pass
    unnoticed.  Where the discretization in space does not conserve them well enough, no step is small enough.

    Parameters
    ----------
    quantities : callable
        From a state (n,) to conserved quantities of order 1.
    tolerance : float
        Drift allowed over ``duration``.
    duration : float
        Of the run.
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
        """Return the largest drift over the one that is allowed.

        Parameters
        ----------
        attempt : Attempt

        Returns
        -------
        float
        """
        drift = np.abs(self._quantities(attempt.after) - self._quantities(attempt.before)).max()
        return float(drift) / (self._allowed_rate * attempt.size)


class AdaptiveStep(Remembering):
    """Chooses step sizes from a measured error, with no growth right after a rejection.

    Parameters
    ----------
    measure : ErrorMeasure
    first_error : float
        Error, root mean square of the state, that Euler's method would make in the first step.
    """

    memory = ("_may_grow",)

    def __init__(self, measure: ErrorMeasure, first_error: float) -> None:
        self._measure = measure
        self._first_error = first_error
        self._may_grow = True

    def first_size(self, acceleration: Array) -> float:
        """Return the size of the first attempt.

        Parameters
        ----------
        acceleration : (n,)
            Second derivative of the state in time.

        Returns
        -------
        float
        """
        typical = root_mean_square(acceleration)
        return float(np.sqrt(2 * self._first_error / typical)) if typical > 0 else np.inf

    def judge(self, attempt: Attempt) -> StepDecision:
        """Accept an attempt whose error is allowed, and choose the next size from the error.

        Parameters
        ----------
        attempt : Attempt

        Returns
        -------
        StepDecision
        """
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
        """Reject an attempt that has no finite result.

        Parameters
        ----------
        size : float
            Of the attempt.
        reason : str

        Returns
        -------
        StepDecision
        """
        self._may_grow = False
        return StepDecision(size * _SHRINK, reason)
