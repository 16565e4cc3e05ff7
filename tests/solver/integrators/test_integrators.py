"""What every time integrator must do, on equations with known solutions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.integrators import InitialValueProblem, Integrator, StepFailedError, integrator_for
from solver.scene import Numerics
from tests.solver.steps import FunctionEquation

Array = NDArray[np.float64]

METHODS = [
    Numerics(integrator="bdf"),
    Numerics(integrator="rosenbrock"),
    Numerics(integrator="sdc", order=3),
    Numerics(integrator="sdc", order=4),
    Numerics(integrator="sdc", order=5),
]
every_method = pytest.mark.parametrize("method", METHODS, ids=lambda m: f"{m.integrator}-{m.order}")

# A stiff linear system: a slow rotation, and a decay ten thousand times as fast.
MATRIX = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1e4]])
START = np.array([1.0, 0.0, 1.0])


def exact(time: float) -> Array:
    return np.array([np.cos(time), -np.sin(time), np.exp(-1e4 * time)])


def integrator(
    method: Numerics,
    rate: Callable[[Array], Array],
    jacobian: Array,
    start: Array,
    tolerance: float,
    end: float,
) -> Integrator:
    numerics = method.model_copy(update={"tolerance": tolerance})
    problem = InitialValueProblem(FunctionEquation(rate, lambda _: jacobian), start, 0.0, end)
    return integrator_for(problem, numerics, 2)


def rotation(method: Numerics, tolerance: float, end: float = 6.0) -> Integrator:
    return integrator(method, lambda y: MATRIX @ y, MATRIX, START, tolerance, end)


def final_error(method: Numerics, tolerance: float) -> tuple[float, int]:
    stepper, steps = rotation(method, tolerance), 0
    while True:
        step = stepper.step()
        steps += 1
        if step.end == 6.0:
            return float(np.max(np.abs(step.state - exact(6.0)))), steps


@every_method
def test_it_begins_and_ends_when_told(method: Numerics) -> None:
    numerics = method.model_copy(update={"tolerance": 1e-6})
    equation = FunctionEquation(lambda y: MATRIX @ y, lambda _: MATRIX)
    stepper = integrator_for(InitialValueProblem(equation, exact(2.0), 2.0, 6.0), numerics, 2)
    step = stepper.step()
    assert step.start == 2.0
    np.testing.assert_allclose(step.interpolate(2.0), exact(2.0), rtol=0, atol=1e-6)
    while step.end < 6.0:
        assert step.end > step.start
        step = stepper.step()
    assert step.end == 6.0
    np.testing.assert_allclose(step.state, exact(6.0), rtol=0, atol=1e-4)


@every_method
def test_the_error_follows_the_tolerance(method: Numerics) -> None:
    tolerances = np.array([1e-4, 1e-6, 1e-8, 1e-10])
    errors, steps = zip(*(final_error(method, tolerance) for tolerance in tolerances), strict=True)
    assert np.all(np.array(errors) < 200 * tolerances)
    slope = np.polyfit(np.log(tolerances), np.log(errors), 1)[0]
    assert slope > 0.75  # with orders up to 5 at most 5/6 of a digit of error for each of tolerance
    assert steps[0] < 100  # the fast decay does not limit the steps


@every_method
def test_steps_join_and_are_interpolated_between(method: Numerics) -> None:
    stepper = rotation(method, 1e-8)
    end = 0.0
    for _ in range(60):
        step = stepper.step()
        assert step.start == end < step.end
        end = step.end
        np.testing.assert_allclose(step.interpolate(end), step.state, rtol=0, atol=1e-13)
        middle = (step.start + end) / 2
        np.testing.assert_allclose(step.interpolate(middle), exact(middle), rtol=0, atol=1e-6)


@every_method
def test_the_error_estimate_is_below_the_tolerance_and_of_its_size(method: Numerics) -> None:
    stepper = rotation(method, 1e-6)
    estimates = [stepper.step().local_error for _ in range(30)]
    assert max(estimates) < 1e-6
    assert np.median(estimates) > 1e-9


@every_method
def test_the_tolerance_is_absolute(method: Numerics) -> None:
    """A constant added to the state changes no step: angles grow as membranes tread."""
    shift = np.array([1e4, -1e4, 1e4])
    near = rotation(method, 1e-6)
    far = integrator(method, lambda y: MATRIX @ (y - shift), MATRIX, START + shift, 1e-6, 6.0)
    for _ in range(30):
        assert far.step().end == pytest.approx(near.step().end, rel=1e-3)


@every_method
def test_a_rejected_attempt_is_reported(method: Numerics) -> None:
    """A rate that jumps, at time 2, forces a smaller step."""

    def rate(y: Array) -> Array:
        return np.array([1.0, 0.0 if y[0] < 2 else 50 * (1 - y[1])])

    stepper = integrator(method, rate, np.zeros((2, 2)), np.zeros(2), 1e-6, 4.0)
    shortened = []
    while True:
        step = stepper.step()
        shortened.append((step.start, step.shortened))
        if step.end == 4.0:
            break
    assert any(flag for start, flag in shortened if start > 0)
    assert step.state[1] == pytest.approx(1.0, abs=1e-4)


@every_method
@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_a_rate_that_is_not_finite_fails_with_a_reason(method: Numerics, wrong: float) -> None:
    def rate(y: Array) -> Array:
        return np.where(y > 1.0, wrong, 1.0)

    stepper = integrator(method, rate, np.zeros((1, 1)), np.zeros(1), 1e-6, 10.0)

    def run() -> None:
        for _ in range(10_000):
            stepper.step()

    with pytest.raises(StepFailedError, match=r"step size|finite"):
        run()


@every_method
def test_work_is_counted(method: Numerics) -> None:
    stepper = rotation(method, 1e-6)
    for _ in range(30):
        stepper.step()
    assert stepper.factorizations >= stepper.jacobian_evaluations >= 1
