"""The error that backward differentiation says it has left in the state."""

from __future__ import annotations

from bisect import bisect_left

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from solver.integrators import InitialValueProblem, Step
from solver.integrators.bdf import BackwardDifferentiation
from solver.integrators.control import root_mean_square
from solver.integrators.propagated_error import amounts_along
from solver.motion.jacobian import DenseJacobian
from solver.motion.terms import equation_of_motion
from solver.scene import Numerics, Scene
from solver.simulation.initial_state import placed_state
from tests.solver.scenes import shear_pair
from tests.solver.steps import FunctionEquation, all_steps
from tests.solver.suspensions import suspension

Array = NDArray[np.float64]

# Growth, a slow rotation with a stiff decay, and a growing rotation that drives a stiff component.
MATRICES = {
    "growth": np.array([[1.0]]),
    "rotation": np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1e3]]),
    "driven": np.array([[0.3, 2.0, 0.0], [-2.0, 0.3, 0.0], [0.0, 1.0, -100.0]]),
}


@pytest.mark.parametrize("name", MATRICES)
@pytest.mark.parametrize(("tolerance", "relative"), [(1e-5, 0.3), (1e-7, 0.1)])
def test_the_error_of_a_linear_equation_is_found(name: str, tolerance: float, relative: float) -> None:
    """The estimate neglects higher differences only, so it becomes exact as the tolerance falls."""
    matrix = MATRICES[name]
    start = np.ones(len(matrix))
    equation = FunctionEquation(lambda y: matrix @ y, lambda _: matrix)
    steps = all_steps(
        BackwardDifferentiation(InitialValueProblem(equation, start, 0.0, 10.0), tolerance), 10.0
    )
    for step in steps:
        if step.end < 5.0:
            continue
        assert step.error
        true = step.state - expm(matrix * step.end) @ start
        wrong = root_mean_square(step.error(step.end)[:, 0] - true)
        assert wrong < relative * root_mean_square(true), step.end


def test_an_error_of_the_start_is_carried_on() -> None:
    matrix = MATRICES["driven"]
    start, error = np.ones(3), np.array([1e-3, 0.0, -2e-3])
    equation = FunctionEquation(lambda y: matrix @ y, lambda _: matrix)
    problem = InitialValueProblem(equation, start, 0.0, 5.0, np.stack([error, error], axis=1))
    step = all_steps(BackwardDifferentiation(problem, 1e-8), 5.0)[-1]
    assert step.error
    np.testing.assert_allclose(step.error(5.0)[:, 0], expm(matrix * 5.0) @ error, rtol=0, atol=1e-5)


def test_a_jacobian_that_is_wrong_is_seen_through() -> None:
    """With half the true growth in its Jacobian the error would come out far too small."""
    equation = FunctionEquation(lambda y: y, lambda _: np.array([[0.5]]))
    problem = InitialValueProblem(equation, np.ones(1), 0.0, 10.0)
    step = all_steps(BackwardDifferentiation(problem, 1e-6), 10.0)[-1]
    assert step.error
    assert step.error(10.0)[0, 0] == pytest.approx(step.state[0] - np.exp(10.0), rel=0.4)


SLOWEST = 0.02  # angular velocity at the angle 0; opposite to it the oscillator is 99 times as fast


def oscillator(y: Array) -> Array:
    """Return the slope of a motion that comes to the unit circle and turns at 1 − 0.98 cos(angle)."""
    square = y @ y
    fast = 1.0 - (1.0 - SLOWEST) * y[0] / np.sqrt(square)
    return 5.0 * (1.0 - square) * y + fast * np.array([-y[1], y[0]])


def oscillator_jacobian(y: Array) -> Array:
    size = 1e-6
    columns = [(oscillator(y + size * e) - oscillator(y - size * e)) / (2 * size) for e in np.eye(2)]
    return np.stack(columns, axis=1)


def on_the_circle(time: float) -> Array:
    """Return the exact state from (1, 0) on, with √(1 + a) tan(angle/2) = √(1 − a) tan(√(1 − a²) t/2)."""
    a = 1.0 - SLOWEST
    phase = 0.5 * np.sqrt(1 - a * a) * time
    angle = 2 * np.arctan2(np.sqrt((1 - a) / (1 + a)) * np.sin(phase), np.cos(phase))
    return np.array([np.cos(angle), np.sin(angle)])


@pytest.mark.parametrize("tolerance", [1e-5, 1e-6])
def test_the_error_of_a_motion_that_repeats_itself_stays_a_lead_in_time(tolerance: float) -> None:
    """Six turns, in each of which the lead's error of the state grows and shrinks a hundredfold; 0.3 s."""
    end = 6 * 2 * np.pi / np.sqrt(1 - (1 - SLOWEST) ** 2)
    problem = InitialValueProblem(
        FunctionEquation(oscillator, oscillator_jacobian), np.array([1.0, 0.0]), 0.0, end
    )
    for step in all_steps(BackwardDifferentiation(problem, tolerance), end):
        assert step.error
        true, found = step.state - on_the_circle(step.end), step.error(step.end)[:, 0]
        if step.end > 0.1 * end:
            assert root_mean_square(found - true) < 0.5 * root_mean_square(true), step.end


def lorenz(y: Array) -> Array:
    return np.array([10.0 * (y[1] - y[0]), y[0] * (28.0 - y[2]) - y[1], y[0] * y[1] - 8.0 / 3.0 * y[2]])


def lorenz_jacobian(y: Array) -> Array:
    return np.array([[-10.0, 10.0, 0.0], [28.0 - y[2], -1.0, -y[0]], [y[1], y[0], -8.0 / 3.0]])


def test_an_error_that_grows_for_ever_stays_a_number() -> None:
    """Where motion never repeats itself, errors grow without bound; this one is huge at once."""
    problem = InitialValueProblem(
        FunctionEquation(lorenz, lorenz_jacobian), np.ones(3), 0.0, 20.0, np.full((3, 2), 1e150)
    )
    steps = all_steps(BackwardDifferentiation(problem, 1e-4), 20.0)
    errors = np.array([step.error(step.end) for step in steps if step.error])
    assert len(errors) == len(steps)
    assert np.all(np.isfinite(errors))
    assert np.abs(errors[-1]).max() > 1e6, "nothing is known any more, and it must not look as if it were"


def steps_of(scene: Scene, tolerance: float) -> list[Step]:
    problem = InitialValueProblem(equation_of_motion(scene), placed_state(scene), 0.0, scene.horizon)
    return all_steps(BackwardDifferentiation(problem, tolerance), scene.horizon)


def final(scene: Scene, tolerance: float) -> tuple[Array, Array]:
    """Return the last state and its error."""
    step = steps_of(scene, tolerance)[-1]
    assert step.error
    return step.state, step.error(scene.horizon)[:, 0]


@pytest.mark.parametrize(("hamaker", "horizon"), [(1.5, 12.0), (0.38, 30.0)])
def test_the_error_of_a_pair_is_found(hamaker: float, horizon: float) -> None:
    """All along its way.  Near the critical adhesion strength, 0.36, motion amplifies errors by 100."""
    scene = shear_pair(hamaker, horizon=horizon, numerics=Numerics(points=48))
    exact = steps_of(scene, 1e-9)
    ends = [step.end for step in exact]
    for tolerance in (1e-4, 1e-5):
        ratios = []
        for step in steps_of(scene, tolerance):
            assert step.error
            if step.end > 0.1 * horizon:
                true = step.state - exact[bisect_left(ends, step.end)].interpolate(step.end)
                ratios.append(root_mean_square(true) / root_mean_square(step.error(step.end)[:, 0]))
        assert max(ratios) < 3
        assert 1 / 2 < np.median(ratios) < 2


def test_the_error_of_a_pair_that_turns_for_long_is_found() -> None:
    """Two turns next to the critical adhesion strength; opening, the pair nearly stands still; 2 s."""
    scene = shear_pair(0.38, horizon=500.0, numerics=Numerics(points=32))
    exact, _ = final(scene, 1e-9)
    for tolerance in (1e-5, 1e-6):
        state, error = final(scene, tolerance)
        true = root_mean_square(state - exact)
        assert true / 3 < root_mean_square(error) < 3 * true


def test_points_that_are_shifted_along_a_membrane_are_no_error_that_grows() -> None:
    """Fourteen turns: shifts of the points neither grow nor die out; 6 s."""
    scene = shear_pair(0.7, horizon=600.0, numerics=Numerics(points=32))
    exact, _ = final(scene, 1e-8)
    state, error = final(scene, 1e-5)
    true = root_mean_square(state - exact)
    assert true / 3 < root_mean_square(error) < 3 * true


def test_amounts_of_directions_are_those_of_least_squares() -> None:
    random = np.random.default_rng(0)
    directions, errors = random.standard_normal((3, 20)), random.standard_normal((20, 2))
    found = amounts_along(directions, errors)
    np.testing.assert_allclose(found, np.linalg.lstsq(directions.T, errors)[0], atol=1e-12)
    # Of parallel ones the later one has it all, and a direction that vanishes has nothing.
    more = np.stack([np.zeros(20), 2 * directions[0], directions[1], directions[0]])
    amounts = amounts_along(more, errors)
    np.testing.assert_array_equal(amounts[:2], 0.0)
    best = np.linalg.lstsq(directions[:2].T, errors)[0]
    np.testing.assert_allclose(amounts[[3, 2]], best, atol=1e-12)


def test_an_approximate_jacobian_propagates_nothing() -> None:
    scene = suspension(7, horizon=0.1)
    problem = InitialValueProblem(equation_of_motion(scene), placed_state(scene), 0.0, 0.1)
    assert BackwardDifferentiation(problem, 1e-3).step().error is None
    assert DenseJacobian.exact
