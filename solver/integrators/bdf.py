"""Backward differentiation formulas of variable order 1–5, by SciPy.

Shampine & Reichelt, The MATLAB ODE Suite, SIAM J. Sci. Comput. 18 (1997): quasi-constant step size, with the
NDF modification; the Jacobian is kept until Newton's iteration slows down.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import BDF
from scipy.sparse import csc_array

from solver.integrators.base import Step, StepFailedError
from solver.motion.block_diagonal import BlockDiagonal

Array = NDArray[np.float64]


# Newton's iteration stops when its error is this fraction of the step's tolerance.  SciPy's own choice, the
# root of the tolerance, costs half as many evaluations again at 1e-4, for a period that is no more accurate.
_NEWTON_TOLERANCE = 0.1


class BackwardDifferentiation:
    """BDF with an absolute tolerance on every component of the state.

    Tangent angles grow without bound while a membrane treads, so a tolerance relative to them would loosen
    with time and depend on the frame.
    """

    def __init__(
        self,
        rate: Callable[[Array], Array],
        jacobian: Callable[[Array], Any],
        state: Array,
        tolerance: float,
        end: float,
        start: float = 0.0,
    ) -> None:
        self._rate, self._jacobian = rate, jacobian
        self._bdf = self._formulas(
            fun=self._rate_or_nan,
            t0=start,
            y0=state,
            t_bound=end,
            rtol=100 * np.finfo(float).eps,  # the least that SciPy accepts; set to zero below
            atol=tolerance,
        )
        self._bdf.rtol = 0.0
        self._bdf.newton_tol = _NEWTON_TOLERANCE

    @property
    def jacobian_evaluations(self) -> int:
        """Number of Jacobians made."""
        return int(self._bdf.njev)

    @property
    def factorizations(self) -> int:
        """Number of matrices factorized."""
        return int(self._bdf.nlu)

    def step(self) -> Step:
        """See `Integrator`."""
        bdf = self._bdf
        start, intended, order = bdf.t, bdf.h_abs, bdf.order
        predictor = self._predictor()
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

    def _formulas(self, **arguments: Any) -> BDF:
        """SciPy's solver, with the Jacobian."""
        return BDF(jac=self._jacobian_or_last, **arguments)

    def _predictor(self) -> Callable[[float], Array]:
        """The last step's interpolant, from which the formula extrapolates; at first a straight line."""
        if self._bdf.t_old is not None:
            predictor: Callable[[float], Array] = self._bdf.dense_output()
            return predictor
        start, state, slope = self._bdf.t, self._bdf.y, self._bdf.D[1] / self._bdf.h_abs
        return lambda time: state + (time - start) * slope

    def _rate_or_nan(self, _: float, state: Array) -> Array:
        """The rate; where there is none, NaN: SciPy then tries a smaller step."""
        try:
            return self._rate(state)
        except ArithmeticError:
            return np.full_like(state, np.nan)

    def _jacobian_or_last(self, _: float, state: Array) -> Array:
        """The Jacobian; where there is none, the last one, for a step that will be rejected."""
        try:
            return self._jacobian(state)
        except ArithmeticError:
            if not hasattr(self, "_bdf"):  # the first state of all
                raise
            last: Array = self._bdf.J
            return last


class BlockBackwardDifferentiation(BackwardDifferentiation):
    """The same with a block-diagonal Jacobian.

    What it lacks only slows Newton's iteration, which stops at the same error.
    """

    def _formulas(self, **arguments: Any) -> BDF:
        state = arguments["y0"]
        # SciPy stores and inverts I − c·J by what it is given here; it knows dense and sparse matrices only.
        bdf = BDF(jac=csc_array((len(state), len(state))), **arguments)
        first: BlockDiagonal = self._jacobian(state)

        def jacobian(_: float, state: Array) -> Array:
            bdf.njev += 1
            try:
                return self._jacobian(state).blocks
            except ArithmeticError:
                return bdf.J

        def invert(blocks: Array) -> Array:
            bdf.nlu += 1
            return np.asarray(np.linalg.inv(blocks))

        def solve(inverses: Array, right: Array) -> Array:
            return replace(first, blocks=inverses) @ right

        bdf.njev = 1
        bdf.I, bdf.J = np.eye(first.members.shape[1]), first.blocks
        bdf.jac, bdf.lu, bdf.solve_lu = jacobian, invert, solve
        return bdf
