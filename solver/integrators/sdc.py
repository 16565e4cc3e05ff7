"""Spectral deferred correction with linearly implicit Euler sweeps.

The method is that of (Dutt, Greengard & Rokhlin 2000), with implicit and explicit parts as in (Minion 2003)
and for vesicles as in (Quaife & Biros 2016).  The rate is split as f(y) = J y + (f(y) − J y), with the
Jacobian J at the start of the step.  The first part is implicit and the second explicit.  All of f is in the
residual, so each sweep raises the order by one however exact J is.  Only in modes much faster than the step a
sweep merely divides the error by some factor.  Sweeps with the LU factors of the quadrature would divide it
by more, but would no longer damp these modes, because Lobatto's formula does not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.integrators.collocation import GaussLobatto
from solver.integrators.control import AdaptiveStep, Attempt, ConservedError, EmbeddedError, ErrorMeasure
from solver.integrators.integrator import InitialValueProblem, Integrator, register
from solver.integrators.one_step import Linearization, OneStepIntegrator

if TYPE_CHECKING:
    from solver.scene import Numerics

Array = NDArray[np.float64]

# Where a scene does not say: the least work for errors from 1e-3 to 1e-5.
_USUAL_ORDER = 4


def node_count(order: int) -> int:
    """Return the number of Gauss–Lobatto nodes: the polynomial through the values there has the order too.

    Parameters
    ----------
    order : int
        Of the method.

    Returns
    -------
    int
    """
    return max(order, 2)


def estimate_power(order: int) -> int:
    """Return the power of the step size as which the embedded estimate grows.

    The estimate is the change by the last sweep, which is the error of one order less; order 1 has a sweep
    for it alone.  The error of the quadrature, of far higher order, is not included: the estimate of a rate
    that depends on time alone would be zero.

    Parameters
    ----------
    order : int
        Of the method.

    Returns
    -------
    int
    """
    return max(order, 2)


class _Sweeps:
    """Prediction and corrections at the nodes of one step."""

    def __init__(self, near: Linearization, size: float, rule: GaussLobatto) -> None:
        self._near = near
        self._intervals = size * rule.intervals
        self._integration = size * rule.integration
        # The intervals are symmetric about the middle of the step, so the first half has all the matrices.
        self._solvers = [near.solver(interval) for interval in self._intervals[: rule.count // 2]]

    def predict(self) -> tuple[Array, Array]:
        """Values and slopes (nodes, n) by linearly implicit Euler; the last slope is left open."""
        values, slopes = np.empty((2, len(self._intervals) + 1, len(self._near.state)))
        values[0], slopes[0] = self._near.state, self._near.slope
        for node, interval in enumerate(self._intervals):
            if node > 0:
                slopes[node] = self._near.rate(values[node])
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
                new_slopes[node] = self._near.rate(corrected[node])
                change = corrected[node] - values[node]
                residual += interval * (new_slopes[node] - slopes[node] - self._near.jacobian @ change)
            corrected[node + 1] = values[node + 1] + self._solve(node, residual)
        return corrected, new_slopes

    def _solve(self, node: int, right: Array) -> Array:
        return self._solvers[min(node, len(self._intervals) - 1 - node)](right)


class DeferredCorrection:
    """SDC of a fixed order.

    Parameters
    ----------
    order : int
        1 is linearly implicit Euler without a sweep (IMEX-Euler); every further order is one more sweep, up
        to 8: a ninth would amplify modes much faster than the step.
    """

    def __init__(self, order: int) -> None:
        self._order = order
        self._rule = GaussLobatto(node_count(order))

    def attempt(self, near: Linearization, size: float) -> Attempt:
        """Try a step, see `OneStepMethod`.

        Parameters
        ----------
        near : Linearization
            Where the step begins.
        size : float
            Its duration.

        Returns
        -------
        Attempt
        """
        from scipy.interpolate import KroghInterpolator  # for the reason that `solver.membrane.shapes` gives

        sweeps = _Sweeps(near, size, self._rule)
        values, slopes = sweeps.predict()
        for _ in range(max(self._order - 1, 1)):
            slopes[-1] = near.rate(values[-1])
            previous = values, slopes
            values, slopes = sweeps.correct(values, slopes)
        estimate = values[-1] - previous[0][-1]
        if self._order == 1:  # its one sweep is only an estimate
            values, slopes = previous
        else:
            slopes[-1] = near.rate(values[-1])
        # The polynomial through the values alone: in a mode with rate λ slopes magnify the error by λ.
        polynomial = KroghInterpolator(self._rule.nodes, values)
        return Attempt(
            size=size,
            before=near.state,
            after=values[-1],
            estimate=estimate,
            interpolate=lambda fraction: np.asarray(polynomial(fraction)),
            slope=slopes[-1],
        )


def _of_order(order: int, problem: InitialValueProblem, numerics: Numerics) -> Integrator:
    measure: ErrorMeasure
    if numerics.step_control == "area-length":
        measure = ConservedError(problem.equation.conserved, numerics.tolerance, problem.end, order)
    else:
        measure = EmbeddedError(numerics.tolerance, estimate_power(order))
    control = AdaptiveStep(measure, numerics.tolerance)
    return OneStepIntegrator(DeferredCorrection(order), control, problem)


@register("sdc")
def deferred_correction(problem: InitialValueProblem, numerics: Numerics) -> Integrator:
    """Make the deferred correction that a scene asks for.

    Parameters
    ----------
    problem : InitialValueProblem
    numerics : Numerics

    Returns
    -------
    Integrator
    """
    return _of_order(numerics.order or _USUAL_ORDER, problem, numerics)


@register("imex-euler")
def imex_euler(problem: InitialValueProblem, numerics: Numerics) -> Integrator:
    """Make linearly implicit Euler, which is deferred correction of order 1 (Quaife et al. 2019, appendix A).

    Parameters
    ----------
    problem : InitialValueProblem
    numerics : Numerics

    Returns
    -------
    Integrator
    """
    return _of_order(1, problem, numerics)
