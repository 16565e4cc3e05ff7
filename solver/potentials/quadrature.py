"""How finely a membrane must be sampled for its effect on a nearby point.

The trapezoid rule with spacing h, applied to 1/(s² + d²)^q, misses the integral by the relative amount

    4/Γ(q−½) (z/2)^(q−½) K_(q−½)(z),    z = 2πd/h,

the first alias in Poisson's sum (K: modified Bessel function).  For the Stokeslet (q = 1) this is 2 exp(−z).
Solved for z it tells, from the measured distance alone, by which factor the source is to be interpolated.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import gammaln, kve


def _log_error(order: float, z: float) -> float:
    nu = order - 0.5
    # The scaled Bessel function keeps the exponential out, so that nothing underflows.
    return float(np.log(4.0) - gammaln(nu) + nu * np.log(z / 2) + np.log(kve(nu, z)) - z)


def trapezoid_error(order: float, ratio: float) -> float:
    """Relative error of the trapezoid rule for 1/(s² + d²)^order at distance/spacing ``ratio``.

    At the smallest ratios, where the formula ends, it is said to be 2: as good as no value.
    """
    return min(2.0, float(np.exp(_log_error(order, 2 * np.pi * ratio))))


@cache
def required_ratio(order: float, tolerance: float) -> float:
    """Smallest distance/spacing at which the trapezoid rule integrates 1/(s² + d²)^order to ``tolerance``."""
    lowest = max(order - 0.5, 0.1)  # below it the alias is not small and the estimate says nothing
    z = brentq(lambda z: _log_error(order, z) - np.log(tolerance), lowest, 1e3)
    return float(z) / (2 * np.pi)
