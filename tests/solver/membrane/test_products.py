"""Products of small matrices inside compiled functions: against NumPy."""

from __future__ import annotations

import numpy as np

from solver.membrane.products import multiply, multiply_both, project_out, sum_rows
from solver.membrane.spectral import highest_modes

RANDOM = np.random.default_rng(5)
MATRIX = RANDOM.normal(size=(10, 7))


def test_products_are_those_of_numpy() -> None:
    x, y = RANDOM.normal(size=(2, 7))
    out, out_x, out_y = np.full((3, 10), np.nan)
    multiply(MATRIX, x, out)
    multiply_both(MATRIX, x, y, out_x, out_y)
    np.testing.assert_allclose([out, out_x, out_y], [MATRIX @ x, MATRIX @ x, MATRIX @ y], atol=1e-14)


def test_rows_are_summed_with_their_weights() -> None:
    weights, out = RANDOM.normal(size=10), np.full(7, np.nan)
    sum_rows(weights, MATRIX, out)
    np.testing.assert_allclose(out, weights @ MATRIX, atol=1e-14)


def test_what_is_projected_out_is_gone_and_the_rest_stays() -> None:
    modes, vector = highest_modes(32), RANDOM.normal(size=32)
    rest = vector.copy()
    project_out(modes, rest)
    np.testing.assert_allclose(rest @ modes, 0.0, atol=1e-14)
    np.testing.assert_allclose(vector - rest, modes @ (modes.T @ vector), atol=1e-14)
