"""Backward differentiation formulas of variable order 1 to 5, by SciPy.

Shampine & Reichelt 1997: quasi-constant step size, with the NDF modification; the Jacobian is kept until
Newton's iteration slows down.

SciPy's `BDF` knows dense and sparse matrices only, a relative tolerance, and a Newton tolerance that follows
from it.  What is replaced in it is not part of its public interface: `SCIPY_INTERNALS` lists it, and a test
says which of it has changed in another version of SciPy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import BDF
from scipy.sparse import csc_array

from solver.integrators.integrator import InitialValueProblem, Integrator, Step, StepFailedError, register

if TYPE_CHECKING:
    from solver.motion.jacobian import Jacobian
    from solver.scene import Numerics

Array = NDArray[np.float64]

# Attributes of SciPy's `BDF` that are used here and are not documented.
SCIPY_INTERNALS = (
    "D",  # backward differences of the state; the second row is the step size times the rate at first
    "I",  # from which c·J is subtracted
    "J",  # the last Jacobian
    "error_const",  # by order; times a change of the state it is the local error
    "h_abs",  # size of the next step
    "jac",  # computes J
    "lu",  # factorizes I − c·J
    "newton_tol",  # error at which Newton's iteration stops, over the tolerance
    "order",
    "rtol",
    "solve_lu",  # solves with what `lu` returned
)

# Newton's iteration stops when its error is this fraction of the step's tolerance.  SciPy's own choice, the
# root of the tolerance, costs half as many evaluations again at 1e-4, for a period that is no more accurate.
_NEWTON_TOLERANCE = 0.1


@dataclass(frozen=True)
class _ImplicitSystem:
    """I − duration·J, as SciPy's step writes it: ``I - c * J``, with a number for I and this for J."""

    jacobian: Jacobian
    duration: float = 1.0

    __array_ufunc__: ClassVar[None] = None  # leaves the product with a NumPy number to this class

    def __rmul__(self, factor: float) -> Self:
        return replace(self, duration=factor)

    def __rsub__(self, identity: float) -> Self:
        return self

    def solver(self) -> Callable[[Array], Array]:
        return self.jacobian.solver(self.duration)


class BackwardDifferentiation:
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

    def __init__(self, problem: InitialValueProblem, tolerance: float) -> None:
        self._equation = problem.equation
        self.jacobian_evaluations = 0
        self.factorizations = 0
        size = len(problem.state)
        self._bdf = BDF(
            fun=self._rate_or_nan,
            t0=problem.start,
            y0=problem.state,
            t_bound=problem.end,
            rtol=100 * np.finfo(float).eps,  # the least that SciPy accepts; set to zero below
            atol=tolerance,
            jac=csc_array((size, size)),  # replaced below
        )
        self._bdf.rtol = 0.0
        self._bdf.newton_tol = _NEWTON_TOLERANCE
        self._bdf.I, self._bdf.J = 0.0, self._linearized(problem.state)
        self._bdf.jac, self._bdf.lu, self._bdf.solve_lu = self._linearized_or_last, self._factorized, _solved

    def step(self) -> Step:
        """Take one step; see `Integrator`.

        Returns
        -------
        Step
        """
        bdf = self._bdf
        start, intended, order = bdf.t, bdf.h_abs, bdf.order
        predictor = self._predictor()
        with np.errstate(invalid="ignore"):  # a state without a rate is NaN, and its step is rejected
            bdf.step()
        if bdf.status == "failed":
            raise StepFailedError(f"no step size suffices at time {start:g}")
        if not np.all(np.isfinite(bdf.y)):
            raise StepFailedError("the state is no longer finite")
        change = bdf.y - predictor(bdf.t)
        return Step(
            start=start,
            end=bdf.t,
            state=bdf.y,
            interpolate=bdf.dense_output(),
            local_error=float(bdf.error_const[order] * np.sqrt(np.mean(change**2))),
            shortened=bool(bdf.t - start < 0.999 * min(intended, bdf.t_bound - start)),
        )

    def _predictor(self) -> Callable[[float], Array]:
        """Return what the formula extrapolates: the last step's interpolant, at first a straight line."""
        if self._bdf.t_old is not None:
            predictor: Callable[[float], Array] = self._bdf.dense_output()
            return predictor
        start, state, slope = self._bdf.t, self._bdf.y, self._bdf.D[1] / self._bdf.h_abs
        return lambda time: state + (time - start) * slope

    def _rate_or_nan(self, _: float, state: Array) -> Array:
        """Return the rate; NaN where it does not exist, so that SciPy tries a smaller step."""
        try:
            return self._equation.rate(state)
        except ArithmeticError:
            return np.full_like(state, np.nan)

    def _linearized(self, state: Array) -> _ImplicitSystem:
        self.jacobian_evaluations += 1
        return _ImplicitSystem(self._equation.jacobian(state))

    def _linearized_or_last(self, _: float, state: Array) -> _ImplicitSystem:
        """Return the Jacobian; the last one where it does not exist, for a step that will be rejected."""
        try:
            return self._linearized(state)
        except ArithmeticError:
            last: _ImplicitSystem = self._bdf.J
            return last

    def _factorized(self, system: _ImplicitSystem) -> Callable[[Array], Array]:
        self.factorizations += 1
        return system.solver()


def _solved(solve: Callable[[Array], Array], right: Array) -> Array:
    return solve(right)


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
