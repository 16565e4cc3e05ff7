"""From what a scene asks for to the integrator that does it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from solver.integrators.base import Integrator
from solver.integrators.bdf import BackwardDifferentiation
from solver.integrators.control import AdaptiveStep, ConservedError, EmbeddedError, ErrorMeasure
from solver.integrators.sdc import DeferredCorrection, estimate_power
from solver.scene import Numerics

Array = NDArray[np.float64]

# Of spectral deferred correction, where a scene does not say: the least work for errors from 1e-3 to 1e-5.
_USUAL_ORDER = 4


def integrator_for(
    numerics: Numerics,
    rate: Callable[[Array], Array],
    jacobian: Callable[[Array], Array],
    conserved: Callable[[Array], Array],
    state: Array,
    end: float,
    start: float = 0.0,
) -> Integrator:
    """The integrator that ``numerics`` asks for.

    Parameters
    ----------
    numerics : Numerics
    rate, jacobian : callable
        From a state (n,) to its rate of change (n,), and to the derivative of that, (n, n).
    conserved : callable
        From a state to quantities of order 1 that the exact motion keeps, for the step control by them.
    state : (n,)
    end : float
        When the last step ends.
    start : float
        When the first one begins.
    """
    if numerics.integrator == "bdf":
        return BackwardDifferentiation(rate, jacobian, state, numerics.tolerance, end, start)
    order = 1 if numerics.integrator == "imex-euler" else numerics.order or _USUAL_ORDER
    measure: ErrorMeasure
    if numerics.step_control == "area-length":
        measure = ConservedError(conserved, numerics.tolerance, end, order)
    else:
        measure = EmbeddedError(numerics.tolerance, estimate_power(order))
    control = AdaptiveStep(measure, numerics.tolerance)
    return DeferredCorrection(rate, jacobian, state, end, order, control, start)
