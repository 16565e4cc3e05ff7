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


@cache
def required_ratio(order: float, tolerance: float) -> float:
    """Smallest distance/spacing at which the trapezoid rule integrates 1/(s² + d²)^order to ``tolerance``."""
    nu = order - 0.5

    def excess(z: float) -> float:
        # The scaled Bessel function keeps the exponential out, so that nothing underflows.
        error = np.log(4.0) - gammaln(nu) + nu * np.log(z / 2) + np.log(kve(nu, z)) - z
        return float(error - np.log(tolerance))

    lowest = max(nu, 0.1)  # below it the alias is not small and the estimate says nothing
    return float(brentq(excess, lowest, 1e3)) / (2 * np.pi)
