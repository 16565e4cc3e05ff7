"""How finely a membrane must be sampled for its effect on a nearby point.

The trapezoid rule with spacing h, applied to 1/(s² + d²)^q, misses the integral by the relative amount

    4/Γ(q−½) (z/2)^(q−½) K_(q−½)(z),    z = 2πd/h,

the first alias in Poisson's sum (Trefethen & Weideman 2014; K: modified Bessel function).  For the
Stokeslet (q = 1) this is 2 exp(−z).  Solved for z it tells, from the measured distance alone, by which factor
the source has to be interpolated.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.special import gammaln, kve

from solver.roots import root


def _log_error(order: float, z: float) -> float:
    nu = order - 0.5
    # The scaled Bessel function keeps the exponential out, so that nothing underflows.
    return float(np.log(4.0) - gammaln(nu) + nu * np.log(z / 2) + np.log(kve(nu, z)) - z)


def trapezoid_error(order: float, ratio: float) -> float:
    """Return the relative error of the trapezoid rule for 1/(s² + d²)^order.

    Parameters
    ----------
    order : float
    ratio : float
        Distance over spacing.

    Returns
    -------
    float
        At most 2, where the formula no longer holds.
    """
    return min(2.0, float(np.exp(_log_error(order, 2 * np.pi * ratio))))


@cache
def required_ratio(order: float, tolerance: float) -> float:
    """Return the smallest distance over spacing at which the trapezoid rule is accurate enough.

    Parameters
    ----------
    order : float
        Of the integrand 1/(s² + d²)^order.
    tolerance : float
        Relative error allowed.

    Returns
    -------
    float
    """
    lowest = max(order - 0.5, 0.1)  # below it the alias is not small and the estimate says nothing
    z = root(lambda z: _log_error(order, z) - np.log(tolerance), lowest, 1e3)
    return z / (2 * np.pi)
