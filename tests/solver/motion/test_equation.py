"""Both forms of the equation of motion: steps change what is computed later, recordings do not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.flows import Shear
from solver.motion.equation import EquationOfMotion
from solver.motion.terms import dense_equation, summed_equation
from solver.parallel import SERIAL
from solver.scene import Numerics, Scene
from solver.simulation.initial_state import placed_state
from tests.solver.scenes import smooth_direction, uneven_pair, with_contrasts
from tests.solver.suspensions import suspension

Array = NDArray[np.float64]
Form = Callable[[Scene], EquationOfMotion]

PAIR = uneven_pair(flow=Shear(rate=0.5), numerics=Numerics(points=32, tolerance=1e-9))
CONTRASTS = with_contrasts(PAIR, 3.0, 0.5).model_copy(update={"numerics": Numerics(points=32)})


def summed(scene: Scene) -> EquationOfMotion:
    return summed_equation(scene, SERIAL)


every_form = pytest.mark.parametrize(
    ("form", "scene", "far"),
    [
        (dense_equation, PAIR, 3.0),
        (dense_equation, CONTRASTS, 1.5),
        (summed, suspension(8), 1.0),
    ],
    ids=["dense", "contrast", "summed"],
)


def states_of(scene: Scene, equation: EquationOfMotion, far: float) -> list[Array]:
    """Two of a run, and one so far from them that the search for its tension needs an inverse of its own."""
    start = placed_state(scene)
    small, large = smooth_direction(equation.membranes, 1), smooth_direction(equation.membranes, 2)
    large[equation.membranes.count * equation.membranes.points :] = 0.0
    return [start, start + 0.01 * small, start + far * large]


def of_steps(equation: EquationOfMotion, states: list[Array], between: Callable[[], object]) -> list[Array]:
    """What a step might ask for, with something else before each of its calls."""
    first, second, _ = states
    direction = np.cos(np.arange(first.size))
    calls: list[Callable[[], Array]] = [
        lambda: equation.rate(first),
        lambda: equation.rate(second),
        lambda: equation.jacobian(first) @ direction,
        lambda: equation.rate(second),
        lambda: equation.jacobian(second).solver(0.1)(direction),
        lambda: equation.rate(first),
    ]
    results = []
    for call in calls:
        between()
        results.append(call())
    return results


@every_form
def test_motions_that_are_recorded_leave_no_trace(form: Form, scene: Scene, far: float) -> None:
    undisturbed, recorded = form(scene), form(scene)
    states = states_of(scene, recorded, far)
    expected = of_steps(undisturbed, states, lambda: None)
    found = of_steps(recorded, states, lambda: [recorded.motion(state) for state in states])
    np.testing.assert_array_equal(found, expected)
    assert recorded.evaluations == undisturbed.evaluations
    assert undisturbed.recordings == 0
    assert 6 <= recorded.recordings < 18  # the far state each time, others unless steps know them


@every_form
def test_a_state_that_a_step_has_evaluated_is_recorded_for_nothing(
    form: Form, scene: Scene, far: float
) -> None:
    equation = form(scene)
    state, *_ = states_of(scene, equation, far)
    rate = equation.rate(state)
    np.testing.assert_array_equal(equation.motion(state.copy()).rate, rate)
    assert equation.recordings == 0


@every_form
def test_a_motion_is_the_same_whatever_was_recorded_before(form: Form, scene: Scene, far: float) -> None:
    equation = form(scene)
    states = states_of(scene, equation, far)
    equation.rate(states[0])
    expected = equation.motion(states[1])
    equation.motion(states[2])
    found = equation.motion(states[1])
    for name in ("velocity", "tension", "rate"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)


@every_form
def test_a_motion_has_the_rate_that_a_step_is_given(form: Form, scene: Scene, far: float) -> None:
    state, *_ = states_of(scene, form(scene), far)
    np.testing.assert_array_equal(form(scene).motion(state).rate, form(scene).rate(state))


@every_form
def test_the_jacobian_is_that_of_the_state_it_is_asked_for(form: Form, scene: Scene, far: float) -> None:
    """Whatever was evaluated last, to what the search for the tension leaves open."""
    used = form(scene)
    first, second, _ = states_of(scene, used, far)
    direction = smooth_direction(used.membranes, 3)
    fresh = form(scene).jacobian(first) @ direction
    used.rate(second)
    used.motion(second)
    tolerance = 1e-4 * np.max(np.abs(fresh - form(scene).jacobian(second) @ direction))
    assert tolerance > 0
    np.testing.assert_allclose(used.jacobian(first) @ direction, fresh, rtol=0, atol=tolerance)


@every_form
def test_a_state_may_change_in_place_after_it_was_evaluated(form: Form, scene: Scene, far: float) -> None:
    """As that of Newton's iteration does."""
    kept, changed = form(scene), form(scene)
    first, second, _ = states_of(scene, kept, far)
    kept.rate(first)
    state = first.copy()
    changed.rate(state)
    state += 0.1
    np.testing.assert_array_equal(changed.rate(second), kept.rate(second))
    direction = np.cos(np.arange(first.size))
    kept.rate(first)
    state[:] = first
    changed.rate(state)
    state += 0.1
    np.testing.assert_array_equal(changed.jacobian(first) @ direction, kept.jacobian(first) @ direction)
