"""From what a scene asks for to the integrator that does it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from solver.integrators.base import Integrator
from solver.integrators.bdf import BackwardDifferentiation, BlockBackwardDifferentiation
from solver.integrators.control import AdaptiveStep, ConservedError, EmbeddedError, ErrorMeasure
from solver.integrators.one_step import OneStepIntegrator, OneStepMethod
from solver.integrators.rodas5p import RODAS5P
from solver.integrators.rosenbrock import Rosenbrock
from solver.integrators.sdc import DeferredCorrection, estimate_power
from solver.motion.block_diagonal import BlockDiagonal
from solver.scene import Numerics

Array = NDArray[np.float64]

# Of spectral deferred correction, where a scene does not say: the least work for errors from 1e-3 to 1e-5.
_USUAL_ORDER = 4


def usual_integrator(vesicles: int) -> Literal["bdf", "rosenbrock"]:
    """What "auto" is for this number of vesicles; `ensemble report work-precision` measures why.

    One vesicle settles, so that its errors die out, and its Jacobian is cheap: there long steps win.
    """
    return "rosenbrock" if vesicles == 1 else "bdf"


def integrator_for(
    numerics: Numerics,
    vesicles: int,
    rate: Callable[[Array], Array],
    jacobian: Callable[[Array], Array] | Callable[[Array], BlockDiagonal],
    conserved: Callable[[Array], Array],
    state: Array,
    end: float,
    start: float = 0.0,
    block_diagonal: bool = False,
) -> Integrator:
    """The integrator that ``numerics`` asks for.

    Parameters
    ----------
    numerics : Numerics
    vesicles : int
        How many are in the fluid; it decides what "auto" is.
    rate, jacobian : callable
        From a state (n,) to its rate of change (n,), and to the derivative of that, (n, n); with
        ``block_diagonal`` to a `BlockDiagonal` that is close to it, which "rosenbrock" does not take.
    conserved : callable
        From a state to quantities of order 1 that the exact motion keeps, for the step control by them.
    state : (n,)
    end : float
        When the last step ends.
    start : float
        When the first one begins.
    """
    integrator = usual_integrator(vesicles) if numerics.integrator == "auto" else numerics.integrator
    if integrator == "bdf":
        formulas = BlockBackwardDifferentiation if block_diagonal else BackwardDifferentiation
        return formulas(rate, jacobian, state, numerics.tolerance, end, start)
    method: OneStepMethod
    measure: ErrorMeasure
    if integrator == "rosenbrock":
        method = Rosenbrock(RODAS5P)
        measure = EmbeddedError(numerics.tolerance, RODAS5P.order)
    else:
        order = 1 if integrator == "imex-euler" else numerics.order or _USUAL_ORDER
        method = DeferredCorrection(order)
        if numerics.step_control == "area-length":
            measure = ConservedError(conserved, numerics.tolerance, end, order)
        else:
            measure = EmbeddedError(numerics.tolerance, estimate_power(order))
    control = AdaptiveStep(measure, numerics.tolerance)
    return OneStepIntegrator(method, control, rate, jacobian, state, end, start)
