"""The loop of all methods that start from one state: try a step, judge it, keep it or try a smaller one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu_factor, lu_solve

from solver.integrators.base import Step, StepFailedError
from solver.integrators.control import Attempt, StepControl, root_mean_square
from solver.motion.block_diagonal import BlockDiagonal

Array = NDArray[np.float64]


class Linearization:
    """The equation of motion near the state in which a step begins.

    Parameters
    ----------
    rate : callable
        From a state (n,) to its rate of change (n,).
    state, slope : (n,)
        Where the step begins, and the rate there.
    jacobian : (n, n) or BlockDiagonal
        The derivative of the rate there.
    """

    def __init__(
        self, rate: Callable[[Array], Array], state: Array, slope: Array, jacobian: Array | BlockDiagonal
    ) -> None:
        self._rate = rate
        self.state = state
        self.slope = slope
        self.jacobian = jacobian
        self.factorizations = 0

    def rate(self, state: Array) -> Array:
        """The rate in another state.

        Raises
        ------
        ArithmeticError
            If there is none.
        """
        if not np.all(np.isfinite(state)):
            raise FloatingPointError("the state is no longer finite")
        slope = self._rate(state)
        if not np.all(np.isfinite(slope)):
            raise FloatingPointError("the rate of change is not finite")
        return slope

    def solver(self, duration: float) -> Callable[[Array], Array]:
        """Solve (I − duration·jacobian) x = b, from b (n,) to x (n,)."""
        self.factorizations += 1
        if isinstance(self.jacobian, BlockDiagonal):
            return self.jacobian.solver(duration)
        matrix = np.eye(len(self.state)) - duration * self.jacobian
        factors = lu_factor(matrix, overwrite_a=True, check_finite=False)
        return lambda right: np.asarray(lu_solve(factors, right, check_finite=False))


class OneStepMethod(Protocol):
    """Computes a step of a given size."""

    def attempt(self, near: Linearization, size: float) -> Attempt:
        """Try a step.

        Raises
        ------
        ArithmeticError
            If it has no finite result.
        """


class OneStepIntegrator:
    """A one-step method in steps of a controlled size.

    Parameters
    ----------
    method : OneStepMethod
    control : StepControl
    rate, jacobian : callable
        From a state (n,) to its rate of change (n,), and to the derivative of that, (n, n) or BlockDiagonal.
    state : (n,)
        Where the first step begins.
    end, start : float
        When the last step ends and the first begins.
    """

    def __init__(
        self,
        method: OneStepMethod,
        control: StepControl,
        rate: Callable[[Array], Array],
        jacobian: Callable[[Array], Array] | Callable[[Array], BlockDiagonal],
        state: Array,
        end: float,
        start: float = 0.0,
    ) -> None:
        self.jacobian_evaluations = 0
        self.factorizations = 0
        self._method = method
        self._control = control
        self._rate = rate
        self._jacobian = jacobian
        self._time = start
        self._end = end
        self._state = state
        self._slope: Array | None = None
        self._size: float | None = None

    def step(self) -> Step:
        """See `Integrator`."""
        start = self._time
        near = self._linearize()
        if self._size is None:
            self._size = self._control.first_size(near.jacobian @ near.slope)
        shortened = False
        while True:
            last = self._size >= self._end - start
            size = self._end - start if last else self._size
            try:
                attempt = self._method.attempt(near, size)
            except ArithmeticError as error:
                verdict = self._control.reject(size, str(error))
            else:
                verdict = self._control.judge(attempt)
            self._size = verdict.size
            if verdict.rejection is None:
                break
            shortened = True
            if self._size < 16 * np.spacing(self._end):
                raise StepFailedError(f"no step size suffices at time {start:g}: {verdict.rejection}")
        self.factorizations += near.factorizations
        self._time = self._end if last else start + size
        self._state, self._slope = attempt.after, attempt.slope
        return Step(
            start=start,
            end=self._time,
            state=attempt.after,
            interpolate=lambda time: attempt.interpolate((time - start) / size),
            local_error=root_mean_square(attempt.estimate),
            shortened=shortened,
        )

    def _linearize(self) -> Linearization:
        matrix = self._jacobian(self._state)
        self.jacobian_evaluations += 1
        slope = self._rate(self._state) if self._slope is None else self._slope
        return Linearization(self._rate, self._state, slope, matrix)
