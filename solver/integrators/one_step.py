"""Integrators that begin every step afresh: a method that computes a step, and control of its size."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from solver.integrators.control import Attempt, StepControl, root_mean_square
from solver.integrators.integrator import DifferentialEquation, InitialValueProblem, Step, StepFailedError
from solver.memory import Remembering

if TYPE_CHECKING:
    from solver.motion.jacobian import Jacobian

Array = NDArray[np.float64]


class Linearization:
    """A differential equation near the state in which a step begins.

    Parameters
    ----------
    equation : DifferentialEquation
    state : (n,)
        In which the step begins.
    slope : (n,)
        The rate there.
    jacobian : Jacobian
        The derivative of the rate there.

    Attributes
    ----------
    factorizations : int
        Number of matrices factorized.
    """

    def __init__(
        self, equation: DifferentialEquation, state: Array, slope: Array, jacobian: Jacobian
    ) -> None:
        self._equation = equation
        self.state = state
        self.slope = slope
        self.jacobian = jacobian
        self.factorizations = 0

    def rate(self, state: Array) -> Array:
        """Compute the rate in another state.

        Parameters
        ----------
        state : (n,)

        Returns
        -------
        (n,)

        Raises
        ------
        ArithmeticError
            If it does not exist.
        """
        if not np.all(np.isfinite(state)):
            raise FloatingPointError("the state is no longer finite")
        slope = self._equation.rate(state)
        if not np.all(np.isfinite(slope)):
            raise FloatingPointError("the rate of change is not finite")
        return slope

    def solver(self, duration: float) -> Callable[[Array], Array]:
        """Factorize I − duration·jacobian.

        Parameters
        ----------
        duration : float
            Part of a time step.

        Returns
        -------
        callable
            From a right-hand side (n,) to the solution (n,).
        """
        self.factorizations += 1
        return self.jacobian.solver(duration)


class OneStepMethod(Protocol):
    """Computes a step of a given size."""

    def attempt(self, near: Linearization, size: float) -> Attempt:
        """Try a step.

        Parameters
        ----------
        near : Linearization
            Where the step begins.
        size : float
            Its duration.

        Returns
        -------
        Attempt

        Raises
        ------
        ArithmeticError
            If it has no finite result.
        """


class OneStepIntegrator(Remembering):
    """A one-step method in steps of a controlled size.

    The method has no memory.

    Parameters
    ----------
    method : OneStepMethod
    control : StepControl
    problem : InitialValueProblem
    """

    memory = (
        "jacobian_evaluations",
        "factorizations",
        "_control",
        "_time",
        "_state",
        "_slope",
        "_size",
    )

    def __init__(self, method: OneStepMethod, control: StepControl, problem: InitialValueProblem) -> None:
        self.jacobian_evaluations = 0
        self.factorizations = 0
        self._method = method
        self._control = control
        self._equation = problem.equation
        self._time = problem.start
        self._end = problem.end
        self._state = problem.state
        self._slope: Array | None = None
        self._size: float | None = None

    def step(self) -> Step:
        """Take one step; see `Integrator`.

        Returns
        -------
        Step
        """
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
                decision = self._control.reject(size, str(error))
            else:
                decision = self._control.judge(attempt)
            self._size = decision.size
            if decision.rejection is None:
                break
            shortened = True
            if self._size < 16 * np.spacing(self._end):
                raise StepFailedError(f"no step size suffices at time {start:g}: {decision.rejection}")
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
        jacobian = self._equation.jacobian(self._state)
        self.jacobian_evaluations += 1
        slope = self._equation.rate(self._state) if self._slope is None else self._slope
        return Linearization(self._equation, self._state, slope, jacobian)
