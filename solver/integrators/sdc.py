"""Spectral deferred correction with linearly implicit Euler sweeps.

Dutt, Greengard & Rokhlin, BIT 40 (2000); Minion, Commun. Math. Sci. 1 (2003); for vesicles Quaife & Biros,
J. Comput. Phys. 306 (2016).  The rate is split as f(y) = J y + (f(y) − J y), the first part implicit and the
second explicit, with J the Jacobian at the start of the step.  All of f is in the residual, so each sweep
raises the order by one however exact J is; only in modes much faster than the step it merely divides the
error by some factor.  (Sweeps with the LU factors of the quadrature would divide it by more, but no longer
damp these modes: Lobatto's formula does not.)
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import KroghInterpolator
from scipy.linalg import lu_factor, lu_solve

from solver.integrators.base import Step, StepFailedError
from solver.integrators.collocation import GaussLobatto
from solver.integrators.control import Attempt, StepControl, root_mean_square

Array = NDArray[np.float64]


def node_count(order: int) -> int:
    """Number of Gauss–Lobatto nodes for an order: the polynomial through their values has the order too."""
    return max(order, 2)


def estimate_power(order: int) -> int:
    """The power of the step size as which the embedded estimate grows.

    It is what the last sweep changes, so the error of one order less; order 1 has a sweep for it alone.  The
    error of the quadrature, of far higher order, is not in it: a rate that depends on time alone would pass.
    """
    return max(order, 2)


class _Sweeps:
    """Prediction and corrections at the nodes of one step size, with one Jacobian."""

    def __init__(
        self, rate: Callable[[Array], Array], jacobian: Array, size: float, rule: GaussLobatto
    ) -> None:
        self._rate = rate
        self._jacobian = jacobian
        self._intervals = size * rule.intervals
        self._integration = size * rule.integration
        identity = np.eye(len(jacobian))
        # The intervals are symmetric about the middle of the step, so the first half has all the matrices.
        self._factors = [
            lu_factor(identity - interval * jacobian, overwrite_a=True, check_finite=False)
            for interval in self._intervals[: rule.count // 2]
        ]

    @property
    def factorizations(self) -> int:
        """Number of matrices factorized."""
        return len(self._factors)

    def slope(self, value: Array) -> Array:
        """The rate at a node.

        Raises
        ------
        FloatingPointError
            If there is none.
        """
        if not np.all(np.isfinite(value)):
            raise FloatingPointError("the state is no longer finite")
        slope = self._rate(value)
        if not np.all(np.isfinite(slope)):
            raise FloatingPointError("the rate of change is not finite")
        return slope

    def predict(self, state: Array, slope: Array) -> tuple[Array, Array]:
        """Values and slopes (nodes, n) by linearly implicit Euler; the last slope is left open."""
        values, slopes = np.empty((2, len(self._intervals) + 1, len(state)))
        values[0], slopes[0] = state, slope
        for node, interval in enumerate(self._intervals):
            if node > 0:
                slopes[node] = self.slope(values[node])
            values[node + 1] = values[node] + self._solve(node, interval * slopes[node])
        return values, slopes

    def correct(self, values: Array, slopes: Array) -> tuple[Array, Array]:
        """Values and slopes after one sweep over the correction equation; the last slope is left open."""
        integrals = self._integration @ slopes
        corrected, new_slopes = np.empty((2, *values.shape))
        corrected[0], new_slopes[0] = values[0], slopes[0]
        for node, interval in enumerate(self._intervals):
            residual = corrected[node] + integrals[node] - values[node + 1]
            if node > 0:
                new_slopes[node] = self.slope(corrected[node])
                change = corrected[node] - values[node]
                residual += interval * (new_slopes[node] - slopes[node] - self._jacobian @ change)
            corrected[node + 1] = values[node + 1] + self._solve(node, residual)
        return corrected, new_slopes

    def _solve(self, node: int, right: Array) -> Array:
        factors = self._factors[min(node, len(self._intervals) - 1 - node)]
        return np.asarray(lu_solve(factors, right, check_finite=False))


class DeferredCorrection:
    """SDC of a fixed order, in steps of a controlled size.

    Parameters
    ----------
    rate, jacobian : callable
        From a state (n,) to its rate of change (n,), and to the derivative of that, (n, n).
    state : (n,)
        At time ``start``.
    end : float
        The last step ends here.
    order : int
        1 is linearly implicit Euler without a sweep (IMEX-Euler); every further order is one more sweep, up
        to 8: a ninth would amplify modes much faster than the step.
    control : StepControl
    start : float
        The first step begins here.
    """

    def __init__(
        self,
        rate: Callable[[Array], Array],
        jacobian: Callable[[Array], Array],
        state: Array,
        end: float,
        order: int,
        control: StepControl,
        start: float = 0.0,
    ) -> None:
        self.jacobian_evaluations = 0
        self.factorizations = 0
        self._rate = rate
        self._jacobian = jacobian
        self._time = start
        self._state = state
        self._slope = rate(state)
        self._end = end
        self._order = order
        self._control = control
        self._size: float | None = None
        self._rule = GaussLobatto(node_count(order))

    def step(self) -> Step:
        """See `Integrator`."""
        start = self._time
        matrix = self._jacobian(self._state)
        self.jacobian_evaluations += 1
        if self._size is None:
            self._size = self._control.first_size(matrix @ self._slope)
        shortened = False
        while True:
            last = self._size >= self._end - start
            size = self._end - start if last else self._size
            try:
                attempt, values, slopes = self._attempt(matrix, size)
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
        self._time = self._end if last else start + size
        self._state, self._slope = values[-1], slopes[-1]
        return Step(
            start=start,
            end=self._time,
            state=self._state,
            interpolate=self._interpolant(start, size, values),
            local_error=root_mean_square(attempt.estimate),
            shortened=shortened,
        )

    def _attempt(self, matrix: Array, size: float) -> tuple[Attempt, Array, Array]:
        """Try a step; return also the values and slopes at its nodes."""
        sweeps = _Sweeps(self._rate, matrix, size, self._rule)
        self.factorizations += sweeps.factorizations
        values, slopes = sweeps.predict(self._state, self._slope)
        for _ in range(max(self._order - 1, 1)):
            slopes[-1] = sweeps.slope(values[-1])
            previous = values, slopes
            values, slopes = sweeps.correct(values, slopes)
        estimate = values[-1] - previous[0][-1]
        if self._order == 1:  # its one sweep is only an estimate
            values, slopes = previous
        else:
            slopes[-1] = sweeps.slope(values[-1])
        return Attempt(size, values[0], values[-1], estimate), values, slopes

    def _interpolant(self, start: float, size: float, values: Array) -> Callable[[float], Array]:
        """The polynomial through the values at the nodes.

        Slopes are left out of it: in a mode with rate λ they magnify the error by λ.
        """
        polynomial = KroghInterpolator(self._rule.nodes, values)
        return lambda time: np.asarray(polynomial((time - start) / size))
