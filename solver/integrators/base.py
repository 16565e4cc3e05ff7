"""What the time loop asks of an integrator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class StepFailedError(ArithmeticError):
    """No further step is possible; the message says why."""


@dataclass(frozen=True)
class Step:
    """One accepted step.

    interpolate : maps a time in [start, end] to the state there, to the method's order.
    local_error : root mean square of the estimated error that the step added to the state.
    shortened : whether a first attempt with a larger step was rejected.
    """

    start: float
    end: float
    state: Array
    interpolate: Callable[[float], Array]
    local_error: float
    shortened: bool

    def until(self, time: float) -> Self:
        """The part of the step up to a time in it."""
        return replace(self, end=time, state=self.interpolate(time))


class Integrator(Protocol):
    """Advances a state in time, one accepted step after the other."""

    @property
    def jacobian_evaluations(self) -> int:
        """Number of Jacobians made."""

    @property
    def factorizations(self) -> int:
        """Number of matrices factorized."""

    def step(self) -> Step:
        """Take one step.

        Raises
        ------
        StepFailedError
            If no step of representable size satisfies the tolerance.
        """
