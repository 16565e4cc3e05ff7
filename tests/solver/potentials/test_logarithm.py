"""The logarithm that the compiled sums compute from a number's bits, and the reciprocal beside it."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from solver.potentials.logarithm import LOGARITHM_UNIT, logarithm, logarithm_and_reciprocal

Array = NDArray[np.float64]


@njit
def logarithms(x, out):  # type: ignore[no-untyped-def]
    for i in range(x.size):
        out[i] = logarithm(x[i])


@njit
def logarithms_and_reciprocals(x, logarithms, reciprocals):  # type: ignore[no-untyped-def]
    for i in range(x.size):
        logarithms[i], reciprocals[i] = logarithm_and_reciprocal(x[i])


def errors(x: Array) -> tuple[Array, Array]:
    """Deviation from the logarithm in extended precision, and that logarithm."""
    out = np.empty_like(x)
    logarithms(x, out)
    exact = np.log(x.astype(np.longdouble))
    return np.abs(out - exact), np.abs(exact)


@pytest.mark.parametrize("magnitude", [-300, -30, -8, -2, 2, 8, 30, 300])
def test_the_logarithm_is_accurate_at_any_magnitude(magnitude: int) -> None:
    x = 10.0**magnitude * np.random.default_rng(0).uniform(1, 10, 200_000)
    error, exact = errors(x)
    assert np.max(error / exact) < 4e-16


def test_the_logarithm_is_accurate_around_one() -> None:
    """There it is small, and what counts is the absolute error."""
    x = np.concatenate(
        [np.random.default_rng(1).uniform(0.5, 2.0, 400_000), 1 + np.geomspace(1e-15, 0.1, 1000)]
    )
    error, _ = errors(x)
    assert np.max(error) < 4e-16
    assert errors(np.array([1.0]))[0] == 0


def test_the_logarithm_has_no_jump_where_the_exponent_changes() -> None:
    for boundary in (np.sqrt(0.5), 1.0, np.sqrt(2.0), 2.0):
        x = np.array([np.nextafter(boundary, 0), boundary, np.nextafter(boundary, 9)])
        assert np.max(errors(x)[0]) < 2e-16


@pytest.mark.parametrize("magnitude", [-300, -140, -30, -8, -2, 0, 2, 8, 30, 300])
def test_logarithm_and_reciprocal(magnitude: int) -> None:
    x = 10.0**magnitude * np.random.default_rng(0).uniform(0.5, 5, 200_000)
    logarithms, reciprocals = np.empty((2, x.size))
    logarithms_and_reciprocals(x, logarithms, reciprocals)
    exact = np.log(x.astype(np.longdouble))
    # Around one the logarithm is small, and what counts is the absolute error.
    error = np.abs(LOGARITHM_UNIT * logarithms - exact) / np.maximum(1, np.abs(exact))
    assert np.max(error) < 4e-16
    assert np.max(np.abs(reciprocals * x.astype(np.longdouble) - 1)) < 4e-16
