"""Step control, and the loop that all one-step methods share."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.integrators import InitialValueProblem, StepFailedError
from solver.integrators.control import AdaptiveStep, Attempt, ConservedError, EmbeddedError
from solver.integrators.one_step import OneStepIntegrator
from solver.integrators.sdc import DeferredCorrection
from solver.motion.terms import dense_equation
from solver.simulation.initial_state import placed_state
from tests.solver.scenes import uneven_pair
from tests.solver.steps import EqualSteps, FunctionEquation, all_steps

Array = NDArray[np.float64]


def attempt(error: float, size: float = 0.1) -> Attempt:
    return Attempt(size, np.zeros(3), np.full(3, 0.5), np.full(3, error), lambda _: np.zeros(3))


def test_the_next_size_follows_the_error_within_limits() -> None:
    control = AdaptiveStep(EmbeddedError(1e-4, power=4), 1e-4)
    assert control.judge(attempt(1e-4)).size == pytest.approx(0.09)
    assert control.judge(attempt(1e-4 / 1.5**4)).size == pytest.approx(0.1 * 1.5 * 0.9)
    assert control.judge(attempt(0.0)).size == pytest.approx(0.5)
    rejected = control.judge(attempt(1e4))
    assert rejected.size == pytest.approx(0.02)
    assert rejected.rejection == "the estimated error is 1e+08 times what is allowed"


def test_no_growth_right_after_a_rejection() -> None:
    control = AdaptiveStep(EmbeddedError(1e-4, power=4), 1e-4)
    assert control.judge(attempt(1e-3)).rejection
    assert control.judge(attempt(1e-9)).size == pytest.approx(0.1)
    assert control.judge(attempt(1e-4 / 4**4)).size == pytest.approx(0.1 * 4 * 0.9)


@pytest.mark.parametrize("error", [np.nan, np.inf])
def test_an_estimate_that_is_not_finite_is_a_rejection(error: float) -> None:
    verdict = AdaptiveStep(EmbeddedError(1e-4, power=4), 1e-4).judge(attempt(error))
    assert verdict.rejection == "the estimated error is not finite"
    assert verdict.size < 0.1


def test_conserved_quantities_may_drift_in_proportion_to_the_step() -> None:
    measure = ConservedError(lambda y: y[:1], tolerance=0.1, duration=10.0, order=2)
    assert measure.excess(attempt(0.0)) == pytest.approx(0.5 / (0.1 * 0.1 / 10.0))
    blind = ConservedError(lambda y: y[:1] - y[1:2], tolerance=0.1, duration=10.0, order=2)
    assert blind.excess(attempt(1.0)) == 0


def test_a_gap_in_a_curve_counts_the_same_wherever_the_vesicle_is() -> None:
    dynamics = dense_equation(uneven_pair())
    state = placed_state(uneven_pair())
    state[:10] += 0.01
    far = state.copy()
    far[-4:] += 100.0
    near, moved = (dynamics.conserved(y) for y in (state, far))
    np.testing.assert_allclose(moved, near, rtol=0, atol=1e-12)
    assert np.abs(near[2:]).max() > 1e-4


def test_a_rate_that_cannot_be_evaluated_shortens_the_step() -> None:
    """Beyond 1 there is no rate; the state approaches 0.9."""

    def rate(y: Array) -> Array:
        if y[0] > 1:
            raise ArithmeticError("out of range")
        return 0.9 - y

    jacobian = np.array([[1e-3]])  # wrong, so that long steps overshoot
    control = AdaptiveStep(EmbeddedError(0.1, power=3), 0.1)
    problem = InitialValueProblem(FunctionEquation(rate, lambda _: jacobian), np.zeros(1), 0.0, 30.0)
    integrator = OneStepIntegrator(DeferredCorrection(3), control, problem)
    steps = all_steps(integrator, 30.0)
    assert any(step.shortened for step in steps)
    assert steps[-1].state[0] == pytest.approx(0.9, abs=0.1)


def test_a_rejection_that_leaves_no_size_ends_the_run() -> None:
    equation = FunctionEquation(lambda y: np.where(y > 1, np.nan, 1.0), lambda _: np.zeros((1, 1)))
    problem = InitialValueProblem(equation, np.zeros(1), 0.0, 2.0)
    integrator = OneStepIntegrator(DeferredCorrection(2), EqualSteps(0.3), problem)
    with pytest.raises(StepFailedError, match=r"at time 0\.9: the rate of change is not finite"):
        all_steps(integrator, 2.0)
