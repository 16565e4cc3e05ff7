"""The matrices of trigonometric interpolation are exact on trigonometric polynomials."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad

from solver.membrane.spectral import (
    differentiation,
    integration,
    interpolation,
    logarithm_weights,
    resampled,
    tail,
)

Array = NDArray[np.float64]
Function = Callable[[Array], Array]


def angles(points: int) -> Array:
    return 2 * np.pi * np.arange(points) / points


class Polynomial:
    """Random trigonometric polynomial Σ Re(c_k exp(ikα)), k = 0…degree."""

    def __init__(self, degree: int, seed: int = 0) -> None:
        random = np.random.default_rng(seed)
        self.k = np.arange(degree + 1)
        self.c = random.standard_normal(degree + 1) + 1j * random.standard_normal(degree + 1)

    def __call__(self, alpha: Array) -> Array:
        return self.derivative(alpha, 0)

    def derivative(self, alpha: Array, order: int) -> Array:
        k, c = (self.k, self.c) if order >= 0 else (self.k[1:], self.c[1:])
        return np.real(np.exp(1j * np.multiply.outer(alpha, k)) @ (c * (1j * k) ** float(order)))


@pytest.mark.parametrize("points", [16, 18, 64])
@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_differentiation_is_exact(points: int, order: int) -> None:
    polynomial = Polynomial(points // 2 - 1)
    exact = polynomial.derivative(angles(points), order)
    scale = (points / 2) ** order * np.abs(polynomial.c).sum()
    np.testing.assert_allclose(
        differentiation(points, order) @ polynomial(angles(points)), exact, rtol=0, atol=1e-14 * scale
    )


def test_the_mode_without_a_sign_has_no_derivative() -> None:
    alternating = np.cos(32 * angles(64))
    np.testing.assert_allclose(differentiation(64) @ alternating, 0, atol=1e-12)


@pytest.mark.parametrize("points", [16, 18, 64])
def test_integration_is_the_antiderivative_of_zero_mean(points: int) -> None:
    polynomial = Polynomial(points // 2 - 1)
    exact = polynomial.derivative(angles(points), -1)
    result = integration(points) @ polynomial(angles(points))
    np.testing.assert_allclose(result, exact, rtol=0, atol=1e-14 * np.abs(polynomial.c).sum())
    assert abs(result.mean()) < 1e-14


@pytest.mark.parametrize("points", [16, 18, 64])
@pytest.mark.parametrize("factor", [1, 2, 3, 8, 32])
def test_interpolation_is_exact(points: int, factor: int) -> None:
    polynomial = Polynomial(points // 2 - 1)
    fine = interpolation(points, factor) @ polynomial(angles(points))
    np.testing.assert_allclose(
        fine, polynomial(angles(factor * points)), rtol=0, atol=1e-14 * np.abs(polynomial.c).sum()
    )


def test_interpolation_keeps_the_values_at_the_points() -> None:
    values = np.random.default_rng(1).standard_normal(32)  # the highest mode included
    np.testing.assert_allclose((interpolation(32, 4) @ values)[::4], values, rtol=0, atol=1e-14)


@pytest.mark.parametrize(("points", "finer"), [(16, 18), (32, 48), (48, 64), (64, 512), (64, 64)])
def test_resampling_is_exact(points: int, finer: int) -> None:
    polynomials = [Polynomial(points // 2 - 1, seed) for seed in range(3)]
    coarse = np.array([polynomial(angles(points)) for polynomial in polynomials])
    fine = np.array([polynomial(angles(finer)) for polynomial in polynomials])
    np.testing.assert_allclose(resampled(coarse, finer), fine, rtol=0, atol=1e-12)


def test_resampling_is_interpolation() -> None:
    values = np.random.default_rng(2).standard_normal((3, 32))  # the highest mode included
    np.testing.assert_allclose(
        resampled(values, 96), values @ interpolation(32, 3).T, rtol=0, atol=1e-14 * 32
    )


def logarithmic_integral(function: Function, alpha: float) -> float:
    """−½∫ log(4 sin²(t/2)) f(α − t) dt, adaptively; log t is split off and integrated with its own weight."""

    def smooth(t: float) -> float:
        return float(np.log(2 * np.sin(t / 2) / t)) if t > 0 else 0.0

    total = 0.0
    for side in (1, -1):

        def reflected(t: float, side: int = side) -> float:
            return float(function(np.array(alpha - side * t)))

        accuracy = {"epsabs": 1e-13, "epsrel": 1e-13, "limit": 200}
        total += quad(reflected, 0, np.pi, weight="alg-loga", wvar=(0, 0), **accuracy)[0]
        total += quad(lambda t, f=reflected: smooth(t) * f(t), 0, np.pi, **accuracy)[0]
    return -total


@pytest.mark.parametrize("points", [16, 22])
def test_logarithm_weights_are_exact(points: int) -> None:
    """Also for the highest cosine: on the points the logarithm sees it as it is."""
    polynomial = Polynomial(points // 2 - 1)
    highest = points // 2

    def function(alpha: Array) -> Array:
        return polynomial(alpha) + np.cos(highest * alpha)

    alpha = angles(points)
    exact = [logarithmic_integral(function, a) for a in alpha]
    np.testing.assert_allclose(logarithm_weights(points) @ function(alpha), exact, rtol=0, atol=2e-12)


def test_tail_is_the_amplitude_of_the_last_third() -> None:
    alpha = angles(96)
    low, high = 5.0 * np.cos(31 * alpha + 0.3), 0.25 * np.cos(33 * alpha + 0.7)
    assert tail(low) < 1e-13
    assert tail(low + high) == pytest.approx(0.25, rel=1e-13)
    assert tail(np.stack([low, high])).shape == (2,)


@pytest.mark.parametrize(
    "matrix", [differentiation(16), integration(16), interpolation(16, 2), logarithm_weights(16)]
)
def test_shared_matrices_cannot_be_overwritten(matrix: Array) -> None:
    with pytest.raises(ValueError, match="read-only"):
        matrix[0, 0] = 1.0
