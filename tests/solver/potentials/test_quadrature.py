"""The predicted error of the trapezoid rule near a line is the true one."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import gamma

from solver.potentials.quadrature import required_ratio
from solver.potentials.refinement import MAXIMUM_FACTOR, refinement_factors

Array = NDArray[np.float64]


def trapezoid_error(order: float, ratio: float, shift: float) -> float:
    """Relative error of Σ 1/((j + shift)² + ratio²)^order, summed by brute force, spacing 1.

    The far sources are replaced by their integral from the last midpoint, which is off by less than 1e-17.
    """
    count = 200_000
    j = np.arange(-count, count + 1, dtype=np.longdouble)
    total = np.sum(1 / ((j + shift) ** 2 + np.longdouble(ratio) ** 2) ** order)
    for end in (count + 0.5 + shift, count + 0.5 - shift):
        total += end ** (1 - 2 * order) / (2 * order - 1) - order * ratio**2 * end ** (-1 - 2 * order) / (
            2 * order + 1
        )
    exact = np.sqrt(np.pi) * gamma(order - 0.5) / gamma(order) * ratio ** (1 - 2 * order)
    return float(abs(total / exact - 1))


@pytest.mark.parametrize("tolerance", [1e-4, 1e-7, 1e-10, 1e-12])
@pytest.mark.parametrize("order", [1.0, 2.0, 2.5, 3.0, 5.0, 7.0])
def test_required_ratio_is_where_the_error_reaches_the_tolerance(order: float, tolerance: float) -> None:
    ratio = required_ratio(order, tolerance)
    worst = max(trapezoid_error(order, ratio, shift) for shift in (0.0, 0.5))
    assert worst == pytest.approx(tolerance, rel=2e-3)


@pytest.mark.parametrize("order", [1.0, 3.0, 7.0])
def test_farther_away_the_error_is_smaller(order: float) -> None:
    ratio = required_ratio(order, 1e-6)
    errors = [trapezoid_error(order, factor * ratio, 0.0) for factor in (0.8, 1.0, 1.2)]
    assert errors[0] > 3e-6
    assert errors[0] > errors[1] > errors[2]


def test_factors_are_the_smallest_powers_of_two_that_suffice() -> None:
    ratio = 3.7
    distance = np.geomspace(ratio / MAXIMUM_FACTOR, 40.0, 1000)
    factors = refinement_factors(distance, ratio)
    assert set(factors.tolist()) == {1, 2, 4, 8, 16, 32}
    assert np.all(factors * distance >= ratio * (1 - 1e-8))
    needed = factors > 1
    assert np.all(factors[needed] / 2 * distance[needed] < ratio)
    assert np.all(factors[distance >= ratio] == 1)


def test_factors_are_limited() -> None:
    assert refinement_factors(np.array([1e-9, 0.0]), 3.7).tolist() == [MAXIMUM_FACTOR, MAXIMUM_FACTOR]
