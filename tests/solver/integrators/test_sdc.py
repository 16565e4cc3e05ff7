"""Spectral deferred correction: quadrature, order of convergence, damping."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.integrators.collocation import GaussLobatto
from solver.integrators.sdc import DeferredCorrection
from tests.solver.steps import (
    amplification,
    oscillator_errors,
    oscillator_jacobian,
    pair_errors,
    sheared_pair,
    stiff_errors,
)

Array = NDArray[np.float64]
ORDERS, FINEST = [DeferredCorrection(order) for order in range(1, 6)], DeferredCorrection(6)


# --- Quadrature -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", range(2, 9))
def test_nodes_are_the_ends_and_the_extrema_of_a_legendre_polynomial(count: int) -> None:
    legendre = np.polynomial.legendre.Legendre.basis(count - 1)
    expected = np.concatenate([[-1.0], np.sort(legendre.deriv().roots()), [1.0]])
    np.testing.assert_allclose(GaussLobatto(count).nodes, (1 + expected) / 2, rtol=0, atol=1e-14)


@pytest.mark.parametrize("count", range(2, 9))
def test_weights_over_the_step_are_those_of_gauss_lobatto(count: int) -> None:
    rule = GaussLobatto(count)
    legendre = np.polynomial.legendre.Legendre.basis(count - 1)
    expected = 1 / (count * (count - 1) * legendre(2 * rule.nodes - 1) ** 2)
    np.testing.assert_allclose(rule.integration.sum(axis=0), expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("count", range(2, 9))
def test_integrals_between_nodes_are_exact_for_the_interpolating_polynomial(count: int) -> None:
    rule = GaussLobatto(count)
    for degree in range(count):
        antiderivative = rule.nodes ** (degree + 1) / (degree + 1)
        np.testing.assert_allclose(
            rule.integration @ rule.nodes**degree, np.diff(antiderivative), rtol=0, atol=1e-14
        )
    highest = 2 * count - 3
    whole = rule.integration.sum(axis=0)
    assert whole @ rule.nodes**highest == pytest.approx(1 / (highest + 1), abs=1e-14)
    assert abs(whole @ rule.nodes ** (highest + 1) - 1 / (highest + 2)) > 1e-10


# --- Order of convergence at a fixed step size ------------------------------------------------------------


def crude_jacobian(y: Array) -> Array:
    """Only the diagonal: the rest of the rate is explicit."""
    return np.asarray(np.diag(np.diag(oscillator_jacobian(y))))


@pytest.mark.parametrize("order", range(1, 6))
def test_the_order_is_one_more_than_the_sweeps_with_a_crude_jacobian(order: int) -> None:
    coarse, fine = (
        oscillator_errors(DeferredCorrection(order), count, crude_jacobian)[0] for count in (64, 128)
    )
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("order", [6, 7, 8])
def test_high_orders(order: int) -> None:
    """With larger steps, where the order is not quite reached yet: smaller ones end in round-off."""
    coarse, fine = (
        oscillator_errors(DeferredCorrection(order), count, crude_jacobian)[0] for count in (8, 16)
    )
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.3)


@pytest.mark.parametrize("order", range(1, 6))
def test_the_order_with_the_exact_jacobian(order: int) -> None:
    coarse, fine = (oscillator_errors(DeferredCorrection(order), count)[0] for count in (8, 64))
    assert np.log2(coarse / fine) / 3 > order - 0.2


@pytest.mark.parametrize("order", range(1, 6))
def test_dense_output_has_the_order_of_the_step(order: int) -> None:
    coarse, fine = (
        oscillator_errors(DeferredCorrection(order), count, crude_jacobian)[1] for count in (64, 128)
    )
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.2)


def test_order_of_vesicles_that_adhere_in_shear() -> None:
    """While the step resolves the fastest mode the orders are the theory's, adhesion included.

    Of order 5 only the approach is seen: where a further halving would reach it, the error is 1e-14.
    """
    begin, duration = 0.05, 0.008
    assert 0.3 < sheared_pair(begin)[2] * duration / 16 < 0.4
    errors = pair_errors(begin, duration, (4, 8, 16), ORDERS, FINEST)
    observed = np.log2(errors[:, :-1] / errors[:, 1:])
    np.testing.assert_allclose(observed[:4, 1], [1, 2, 3, 4], rtol=0, atol=0.2)
    assert 4.3 < observed[4, 0] < 5.2


def test_order_in_steps_much_longer_than_the_fastest_decay() -> None:
    """Orders 1 to 3 hold; 4 and 5 fall to between 3 and 4, but each still makes a smaller error."""
    begin, duration = 2.0, 1.0
    assert sheared_pair(begin)[2] * duration / 32 > 20
    errors = pair_errors(begin, duration, (8, 16, 32), ORDERS, FINEST)
    observed = np.log2(errors[:, :-1] / errors[:, 1:])
    np.testing.assert_allclose(observed[:3, 1], [1, 2, 3], rtol=0, atol=0.2)
    assert np.all((observed[3:] > 3) & (observed[3:] < 4))
    assert np.all(np.diff(errors, axis=0) < 0)


# --- Stiffness --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", range(1, 9))
def test_fast_modes_are_damped_at_any_speed(order: int) -> None:
    method = DeferredCorrection(order)
    assert max(amplification(method, decay) for decay in 10.0 ** np.arange(-1, 10)) < 0.95


def test_a_ninth_order_would_amplify_fast_modes() -> None:
    assert amplification(DeferredCorrection(9), 1e9) > 1


@pytest.mark.parametrize("order", range(1, 9))
def test_a_very_stiff_equation_is_followed_within_steps_too(order: int) -> None:
    assert np.max(stiff_errors(DeferredCorrection(order))) < 4e-3
