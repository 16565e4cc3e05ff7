"""The Rosenbrock method: order, dense output, damping, and its error estimate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.integrators.one_step import Linearization
from solver.integrators.rodas5p import RODAS5P
from solver.integrators.rosenbrock import Rosenbrock
from solver.integrators.sdc import DeferredCorrection
from tests.solver.steps import (
    OSCILLATOR_EQUATION,
    OSCILLATOR_START,
    amplification,
    oscillator,
    oscillator_errors,
    pair_errors,
    sheared_pair,
    stiff_errors,
)

Array = NDArray[np.float64]
METHOD = Rosenbrock(RODAS5P)


def at_the_start() -> Linearization:
    state = OSCILLATOR_START
    return Linearization(OSCILLATOR_EQUATION, state, oscillator(state), OSCILLATOR_EQUATION.jacobian(state))


def test_order_five() -> None:
    coarse, fine = (oscillator_errors(METHOD, count)[0] for count in (32, 64))
    assert abs(np.log2(coarse / fine) - 5) < 0.2


def test_dense_output_of_order_four() -> None:
    coarse, fine = (oscillator_errors(METHOD, count)[1] for count in (32, 64))
    assert np.log2(coarse / fine) > 3.8


def test_dense_output_meets_the_ends() -> None:
    attempt = METHOD.attempt(at_the_start(), 0.1)
    np.testing.assert_allclose(attempt.interpolate(0.0), OSCILLATOR_START, rtol=0, atol=1e-15)
    np.testing.assert_allclose(attempt.interpolate(1.0), attempt.after, rtol=0, atol=1e-15)


def test_the_estimate_falls_as_the_fifth_power_of_the_step() -> None:
    estimates = []
    for size in (0.02, 0.01):
        estimates.append(np.abs(METHOD.attempt(at_the_start(), size).estimate).max())
    assert abs(np.log2(estimates[0] / estimates[1]) - RODAS5P.order) < 0.3


def test_fast_modes_are_damped_at_any_speed() -> None:
    factors = [amplification(METHOD, decay) for decay in 10.0 ** np.arange(-1, 10)]
    assert max(factors) < 0.95
    assert factors[-1] < 1e-7 < factors[0]


def test_a_very_stiff_equation_is_followed_within_steps_too() -> None:
    assert np.max(stiff_errors(METHOD)) < 1e-7


def test_order_of_vesicles_that_adhere_in_shear() -> None:
    """Four and more with steps a few times as long as the fastest decay; three and more where it is forty.

    Shorter steps than the first end in round-off: their error is 2e-12.
    """
    moderate = pair_errors(0.05, 0.032, (4, 8), [METHOD], DeferredCorrection(6))[0]
    assert np.log2(moderate[0] / moderate[1]) > 4.2
    begin, duration = 2.0, 1.0
    assert sheared_pair(begin)[2] * duration / 16 > 40
    stiff = pair_errors(begin, duration, (4, 8, 16), [METHOD], METHOD)[0]
    assert np.all(np.log2(stiff[:-1] / stiff[1:]) > 3)
