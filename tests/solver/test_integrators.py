"""The time integrator on equations with known solutions."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.integrators import BackwardDifferentiation, StepFailedError

Array = NDArray[np.float64]

# A stiff linear system: a slow rotation, and a decay ten thousand times as fast.
MATRIX = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1e4]])
START = np.array([1.0, 0.0, 1.0])


def exact(time: float) -> Array:
    return np.array([np.cos(time), -np.sin(time), np.exp(-1e4 * time)])


def rotation(tolerance: float, end: float = 6.0) -> BackwardDifferentiation:
    return BackwardDifferentiation(lambda y: MATRIX @ y, lambda _: MATRIX, START, tolerance, end)


def final_error(tolerance: float) -> tuple[float, int]:
    integrator, steps = rotation(tolerance), 0
    while True:
        step = integrator.step()
        steps += 1
        if step.end == 6.0:
            return float(np.max(np.abs(step.state - exact(6.0)))), steps


def test_the_error_follows_the_tolerance() -> None:
    tolerances = np.array([1e-4, 1e-6, 1e-8, 1e-10])
    errors, steps = zip(*map(final_error, tolerances), strict=True)
    assert np.all(np.array(errors) < 200 * tolerances)
    slope = np.polyfit(np.log(tolerances), np.log(errors), 1)[0]
    assert slope > 0.75  # with orders up to 5 at most 5/6 of a digit of error for each of tolerance
    assert steps[0] < 100  # the fast decay does not limit the steps


def test_steps_join_and_are_interpolated_between() -> None:
    integrator = rotation(1e-8)
    end = 0.0
    for _ in range(80):
        step = integrator.step()
        assert step.start == end < step.end
        end = step.end
        np.testing.assert_allclose(step.interpolate(end), step.state, rtol=0, atol=1e-14)
        middle = (step.start + end) / 2
        np.testing.assert_allclose(step.interpolate(middle), exact(middle), rtol=0, atol=1e-6)


def test_the_error_estimate_is_below_the_tolerance_and_of_its_size() -> None:
    integrator = rotation(1e-6)
    estimates = [integrator.step().local_error for _ in range(60)]
    assert max(estimates) < 1e-6
    assert np.median(estimates) > 1e-9


def test_the_tolerance_is_absolute() -> None:
    """A constant added to the state changes no step: angles grow as membranes tread."""
    shift = np.array([1e4, -1e4, 1e4])
    near = rotation(1e-6)
    far = BackwardDifferentiation(lambda y: MATRIX @ (y - shift), lambda _: MATRIX, START + shift, 1e-6, 6.0)
    for _ in range(30):
        assert far.step().end == pytest.approx(near.step().end, rel=1e-3)


def test_a_rejected_attempt_is_reported() -> None:
    """A rate that jumps forces a smaller step, and only there."""

    def rate(y: Array) -> Array:
        return np.array([1.0, 0.0 if y[0] < 2 else 100 * np.cos(50 * y[0])])

    integrator = BackwardDifferentiation(rate, lambda _: np.zeros((2, 2)), np.zeros(2), 1e-6, 4.0)
    shortened = []
    while True:
        step = integrator.step()
        shortened.append((step.start, step.shortened))
        if step.end == 4.0:
            break
    assert any(flag for _, flag in shortened)
    assert min(start for start, flag in shortened if flag) > 0


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_a_rate_that_is_not_finite_fails_with_a_reason(wrong: float) -> None:
    def rate(y: Array) -> Array:
        return np.where(y > 1.0, wrong, 1.0)

    integrator = BackwardDifferentiation(rate, lambda _: np.zeros((1, 1)), np.zeros(1), 1e-6, 10.0)

    def run() -> None:
        for _ in range(10_000):
            integrator.step()

    with pytest.raises(StepFailedError, match=r"step size|finite"):
        run()


def test_work_is_counted() -> None:
    integrator = rotation(1e-6)
    for _ in range(40):
        integrator.step()
    assert integrator.jacobian_evaluations >= 1
    assert integrator.factorizations > integrator.jacobian_evaluations
