"""The integral of a cubic spline, against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from solver.analysis.spline import spline_integral


@pytest.mark.parametrize("count", [2, 3, 4, 5, 40])
def test_it_is_the_integral_of_scipys_spline(count: int) -> None:
    random = np.random.default_rng(count)
    times = np.cumsum(random.uniform(0.1, 2.0, count))
    values = random.standard_normal((count, 3))
    spline = CubicSpline(times, values)
    limits = [times[0], times[-1], *random.uniform(times[0], times[-1], 4)]
    for first in limits:
        for last in limits:
            expected = spline.integrate(first, last)
            np.testing.assert_allclose(
                spline_integral(times, values, first, last), expected, rtol=0, atol=1e-12
            )


def test_a_cubic_is_integrated_exactly() -> None:
    times = np.array([0.0, 0.3, 1.1, 1.2, 3.0])
    found = spline_integral(times, np.stack([times**3, times**2], axis=1), 0.5, 2.5)
    np.testing.assert_allclose(found, [(2.5**4 - 0.5**4) / 4, (2.5**3 - 0.5**3) / 3], rtol=1e-13)
