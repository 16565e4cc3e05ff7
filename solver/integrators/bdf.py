"""Backward differentiation formulas of variable order 1 to 5 (Shampine & Reichelt 1997).

Quasi-constant step size, with the NDF modification; the Jacobian is kept until Newton's iteration slows down.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.integrators.backward_differences import (
    MAX_ORDER,
    ROWS,
    append,
    extrapolate,
    interpolant,
    rescaling,
)
from solver.integrators.control import root_mean_square
from solver.integrators.integrator import InitialValueProblem, Integrator, Step, StepFailedError, register
from solver.integrators.propagated_error import Evaluation, LinearizedStep, PropagatedError
from solver.memory import Remembering, Saved

if TYPE_CHECKING:
    from solver.scene import Numerics

Array = NDArray[np.float64]

# By order, from 0 (Shampine & Reichelt 1997, section 2).  The formula of order k reads
# (1 − κ) γ (y − y_predicted) + Σₘ γₘ ∇ᵐy = h f(y), and its local error is (κ γ + 1/(k + 1)) ∇ᵏ⁺¹y.
_KAPPA = np.array([0.0, -0.1850, -1 / 9, -0.0823, -0.0415, 0.0])
_GAMMA = np.array([sum(1 / m for m in range(1, k + 1)) for k in range(MAX_ORDER + 1)])
_ALPHA = (1 - _KAPPA) * _GAMMA
_ERROR = (_KAPPA * _GAMMA + 1 / np.arange(1, MAX_ORDER + 2)).tolist()
_WEIGHTS = [_GAMMA[1 : k + 1] / _ALPHA[k] for k in range(MAX_ORDER + 1)]  # of the differences, over (1 − κ) γ

# Newton's iteration stops when its error is this fraction of the step's tolerance.
_NEWTON_TOLERANCE = 0.1
_NEWTON_ITERATIONS = 4

# A slower convergence of it, from one iteration to the next, asks for a new Jacobian before the next step.
# What the Jacobians cost is saved in iterations.
_SLOW = 0.1

_SHRINK, _GROW = 0.2, 10.0  # limits of the factor from one step size to the next


class _Solution(NamedTuple):
    """What Newton's iteration found.

    Attributes
    ----------
    change : (n,)
        From the predicted state.
    state, slope : (n,)
        At the end of the step, by the formula: a rate would magnify what Newton's iteration has left.
    remainder : (n,)
        Estimated error of the change.
    iterations : int
    convergence : float
        Quotient of the last two corrections.
    last : Evaluation
    """

    change: Array
    state: Array
    slope: Array
    remainder: Array
    iterations: int
    convergence: float
    last: Evaluation


class BackwardDifferentiation(Remembering):
    """BDF with an absolute tolerance on every component of the state.

    Tangent angles grow without bound while a membrane treads, so a tolerance relative to them would loosen
    with time and depend on the frame.  What an approximate Jacobian lacks only slows Newton's iteration,
    which stops at the same error.

    Parameters
    ----------
    problem : InitialValueProblem
    tolerance : float
        Largest local error of a step, root mean square.
    """

    memory = (
        "jacobian_evaluations",
        "factorizations",
        "_time",
        "_size",
        "_table",
        "_order",
        "_equal_steps",
        "_slow",
    )

    def __init__(self, problem: InitialValueProblem, tolerance: float) -> None:
        self._equation = problem.equation
        self._tolerance = tolerance
        self._time, self._end = problem.start, problem.end
        self._jacobian = problem.equation.jacobian(problem.state)
        self.jacobian_evaluations, self.factorizations = 1, 0
        slope = problem.equation.rate(problem.state)
        acceleration = self._jacobian @ slope
        longest, largest = self._end - self._time, root_mean_square(acceleration)
        self._size = min(np.sqrt(tolerance / largest), longest) if largest > 0 else longest
        self._table = np.zeros((ROWS, problem.state.size))
        self._table[0], self._table[1] = problem.state, self._size * slope
        self._order = 1
        self._equal_steps = 0
        self._slow = False
        self._solve: Callable[[Array], Array] | None = None
        error = np.zeros((problem.state.size, 2)) if problem.error is None else problem.error
        self._error: PropagatedError | None = None
        if self._jacobian.exact:
            change = self._size * slope
            now = self._directions(slope, problem.state)
            before = self._directions(slope - self._size * acceleration, problem.state - change)
            directions = np.stack([now, now - before])
            self._error = PropagatedError(problem.equation.rate, error, directions, problem.start)

    def saved(self) -> Saved:
        """Return the history, and the Jacobian in use; see `Remembering`.

        Returns
        -------
        dict
        """
        return {
            **super().saved(),
            "jacobian": self._jacobian.saved(),
            "factorized": self._solve is not None,
            "error": self._error.saved(self._jacobian) if self._error else None,
        }

    def restore(self, saved: Saved) -> None:
        """Go on where another one was; see `Remembering`.

        Parameters
        ----------
        saved : dict
        """
        super().restore(saved)
        self._jacobian = self._equation.restored_jacobian(saved["jacobian"])
        # The same matrix has the same factors, to the last bit.
        duration = self._size / _ALPHA[self._order]
        self._solve = self._jacobian.solver(duration) if saved["factorized"] else None
        if self._error:
            self._error.restore(saved["error"], self._jacobian)

    def step(self) -> Step:
        """Take one step; see `Integrator`.

        Returns
        -------
        Step
        """
        start, shortened = self._time, False
        least = 10 * np.spacing(start)
        if self._size < least:
            self._rescale(least / self._size)
        while True:
            if self._size < least:
                raise StepFailedError(f"no step size suffices at time {start:g}")
            end = start + self._size
            if end > self._end:
                end = self._end
                self._rescale((end - start) / self._size)
            solution = self._solved()
            if solution is None:
                self._rescale(0.5)
                shortened = True
                continue
            order = self._order
            excess = _ERROR[order] * root_mean_square(solution.change) / self._tolerance
            safety = 0.9 * (2 * _NEWTON_ITERATIONS + 1) / (2 * _NEWTON_ITERATIONS + solution.iterations)
            if excess <= 1:
                break
            self._rescale(max(_SHRINK, safety * excess ** (-1 / (order + 1))))
            shortened = True
        self._time = end
        self._accept(solution)
        self._choose(excess, safety)
        state = self._table[0].copy()
        if not math.isfinite(state @ state):
            raise StepFailedError("the state is no longer finite")
        history = self._order, end, self._size
        return Step(
            start=start,
            end=end,
            state=state,
            interpolate=interpolant(self._table, *history),
            local_error=float(excess * self._tolerance),
            shortened=shortened,
            evaluated=solution.last.state,
            error=self._error.interpolant(*history) if self._error else None,
        )

    def _solved(self) -> _Solution | None:
        """Return the solution of the formula; if the last Jacobian is too old for it, by a new one."""
        renewed = self._slow and self._renew()
        solution = self._newton(self._linearized())
        if solution is None and not renewed and self._renew():
            solution = self._newton(self._linearized())
        self._slow = solution is not None and solution.convergence > _SLOW
        return solution

    def _renew(self) -> bool:
        """Compute the Jacobian where the step is expected to end, and return whether there is one."""
        try:
            self._jacobian = self._equation.jacobian(self._extrapolated()[0])
        except ArithmeticError:
            return False
        self.jacobian_evaluations += 1
        self._solve = None
        return True

    def _extrapolated(self) -> Array:
        """Return the state that is expected at the end of the step, and Σₘ wₘ ∇ᵐy, (2, n)."""
        extrapolated = np.empty((2, self._table.shape[1]))
        extrapolate(self._table, _WEIGHTS[self._order], *extrapolated)
        return extrapolated

    def _linearized(self) -> LinearizedStep:
        """Return the formula of the present order and step size."""
        order = self._order
        duration = self._size / _ALPHA[order]
        if self._solve is None:
            self._solve = self._jacobian.solver(duration)
            self.factorizations += 1
        return LinearizedStep(order, _WEIGHTS[order], duration, self._jacobian, self._solve)

    def _newton(self, step: LinearizedStep) -> _Solution | None:
        """Return the solution of the formula, None if the iteration does not converge."""
        predicted, history = self._extrapolated()
        state, change, last_size = predicted, np.zeros_like(predicted), math.inf
        for iteration in range(_NEWTON_ITERATIONS):
            evaluation = self._evaluated(state)
            if evaluation is None:
                return None
            correction = step.solve(step.duration * evaluation.rate - history - change)
            size = root_mean_square(correction) / self._tolerance
            quotient, last_size = size / last_size, size
            change = change + correction
            state = predicted + change
            if iteration == 0 and size > 0:
                continue
            left = _NEWTON_ITERATIONS - iteration
            if quotient >= 1 or quotient**left / (1 - quotient) * size > _NEWTON_TOLERANCE:
                return None
            remaining = quotient / (1 - quotient)
            if remaining * size < _NEWTON_TOLERANCE:
                return _Solution(
                    change=change,
                    state=state,
                    slope=(change + history) / step.duration,
                    remainder=-remaining * correction,
                    iterations=iteration + 1,
                    convergence=quotient,
                    last=evaluation,
                )
        return None

    def _evaluated(self, state: Array) -> Evaluation | None:
        """Return the rate in a state, None where it does not exist."""
        try:
            rate = self._equation.rate(state)
        except ArithmeticError:
            return None
        return Evaluation(state, rate) if math.isfinite(rate @ rate) else None

    def _accept(self, solution: _Solution) -> None:
        """Enter the new state, and its error, into the tables."""
        order, change = self._order, solution.change
        if self._error:
            local_error = _ERROR[order] * change
            if self._equal_steps > 0:  # the next term of its expansion
                local_error += (change - self._table[order + 1]) / (order + 2)
            local_error /= _ALPHA[order]
            directions = self._directions(solution.slope, solution.state)
            self._error.advance(
                self._linearized(), directions, local_error, solution.remainder, solution.last
            )
        append(self._table, order, change)
        self._equal_steps += 1

    def _directions(self, slope: Array, state: Array) -> Array:
        """Return the directions in which an error stays, (1 + m, n)."""
        symmetries = self._equation.symmetries(state)
        directions = np.empty((1 + len(symmetries), slope.size))
        directions[0], directions[1:] = slope, symmetries
        return directions

    def _choose(self, excess: float, safety: float) -> None:
        """Choose order and size of the next step, once there are enough equal steps to compare."""
        order, table = self._order, self._table
        if self._equal_steps < order + 1:
            return
        excesses = [np.inf, excess, np.inf]
        if order > 1:
            excesses[0] = _ERROR[order - 1] * root_mean_square(table[order]) / self._tolerance
        if order < MAX_ORDER:
            excesses[2] = _ERROR[order + 1] * root_mean_square(table[order + 2]) / self._tolerance
        factors = [each ** (-1 / (order + k)) if each > 0 else np.inf for k, each in enumerate(excesses)]
        factor = max(factors)
        self._order += factors.index(factor) - 1
        self._rescale(min(_GROW, safety * factor))

    def _rescale(self, factor: float) -> None:
        """Change the step size by a factor."""
        order, table = self._order, self._table
        matrix = rescaling(order, factor)
        if self._error:
            self._error.rescale(order, matrix, table[order + 1])
        table[: order + 1] = matrix[:, :-1] @ table[: order + 1]
        table[order + 1] *= factor ** (order + 1)
        self._size *= factor
        self._equal_steps = 0
        self._solve = None


@register("bdf")
def backward_differentiation(problem: InitialValueProblem, numerics: Numerics) -> Integrator:
    """Make the BDF that a scene asks for.

    Parameters
    ----------
    problem : InitialValueProblem
    numerics : Numerics

    Returns
    -------
    Integrator
    """
    return BackwardDifferentiation(problem, numerics.tolerance)
