"""Imposed flows have the velocities that the scene names, exact gradients and Jacobians, and true facts."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.flows import FLOWS, Extension, ImposedFlow, Shear, Trap

Array = NDArray[np.float64]
RANDOM = np.random.default_rng(5)
POINTS = 3 * RANDOM.standard_normal((2, 4, 7))
CENTERS = RANDOM.standard_normal((2, 3))

every_flow = pytest.mark.parametrize("flow", [flow(rate=0.7) for flow in FLOWS], ids=lambda flow: flow.kind)


def test_shear() -> None:
    velocity = Shear(rate=0.7).velocity(POINTS, CENTERS)
    np.testing.assert_allclose(velocity[0], 0.7 * POINTS[1], rtol=1e-15)
    assert not velocity[1].any()


def test_extension_converges_along_x_and_diverges_along_y() -> None:
    velocity = Extension(rate=0.7).velocity(POINTS, CENTERS)
    np.testing.assert_allclose(velocity, [-0.7 * POINTS[0], 0.7 * POINTS[1]], rtol=1e-15)


def test_the_trap_stagnates_at_the_mean_of_the_centers() -> None:
    x, y = POINTS - CENTERS.mean(axis=1)[:, None, None]
    velocity = Trap(rate=0.7).velocity(POINTS, CENTERS)
    np.testing.assert_allclose(velocity, [-0.7 * x, 0.7 * y], rtol=0, atol=1e-14)


def test_the_trap_follows_the_vesicles() -> None:
    shift = np.array([3.0, -2.0])
    trap, extension = (
        flow.velocity(POINTS + shift[:, None, None], CENTERS + shift[:, None])
        - flow.velocity(POINTS, CENTERS)
        for flow in (Trap(rate=0.7), Extension(rate=0.7))
    )
    np.testing.assert_allclose(trap, 0, atol=1e-14)
    assert np.max(np.abs(extension)) > 1


@every_flow
def test_the_velocity_is_proportional_to_the_rate(flow: ImposedFlow) -> None:
    twice = flow.model_copy(update={"rate": 2 * flow.rate})
    expected = 2 * flow.velocity(POINTS, CENTERS)
    np.testing.assert_allclose(twice.velocity(POINTS, CENTERS), expected, rtol=1e-13)
    assert np.max(np.abs(expected)) > 0.1


@every_flow
def test_the_gradient_is_that_of_the_velocity(flow: ImposedFlow) -> None:
    gradient = flow.velocity_gradient(POINTS)
    assert gradient.shape == (2, *POINTS.shape)
    for direction in range(2):
        step = np.zeros((2, 1, 1))
        step[direction] = 1e-4
        change = flow.velocity(POINTS + step, CENTERS) - flow.velocity(POINTS - step, CENTERS)
        np.testing.assert_allclose(gradient[:, direction], change / 2e-4, rtol=0, atol=1e-9)


@every_flow
def test_the_flow_is_incompressible(flow: ImposedFlow) -> None:
    gradient = flow.velocity_gradient(POINTS)
    np.testing.assert_allclose(gradient[0, 0] + gradient[1, 1], 0, atol=1e-14)


@every_flow
def test_the_jacobian_is_exact(flow: ImposedFlow) -> None:
    """Points and centers move along ten random directions, one of them for each component of a state."""
    points = POINTS.reshape(2, -1)
    by_state = RANDOM.standard_normal((*points.shape, 10))
    centers_by_state = RANDOM.standard_normal((*CENTERS.shape, 10))
    jacobian = flow.jacobian(points, by_state, centers_by_state)
    for component in range(10):
        moved = (1e-4 * by_state[..., component], 1e-4 * centers_by_state[..., component])
        after = flow.velocity(points + moved[0], CENTERS + moved[1])
        before = flow.velocity(points - moved[0], CENTERS - moved[1])
        difference = (after - before) / 2e-4
        np.testing.assert_allclose(jacobian[..., component], difference, rtol=0, atol=1e-8)
    assert np.max(np.abs(jacobian)) > 0.1


@every_flow
def test_the_jacobian_of_a_flow_without_one_of_its_own_comes_from_the_gradient(flow: ImposedFlow) -> None:
    points = POINTS.reshape(2, -1)
    by_state, at_rest = RANDOM.standard_normal((*points.shape, 10)), np.zeros((*CENTERS.shape, 10))
    np.testing.assert_allclose(
        ImposedFlow.jacobian(flow, points, by_state, at_rest),
        flow.jacobian(points, by_state, at_rest),
        rtol=0,
        atol=1e-13,
    )


@every_flow
def test_a_flow_that_says_so_is_odd(flow: ImposedFlow) -> None:
    mirrored = flow.velocity(-POINTS, -CENTERS)
    assert np.allclose(mirrored, -flow.velocity(POINTS, CENTERS), atol=1e-13) or not flow.odd


@every_flow
def test_a_flow_that_rotates_turns_all_lines_the_same_way(flow: ImposedFlow) -> None:
    """Criteria read direction and sense from the gradient at the origin."""
    angles = np.linspace(0, np.pi, 50)
    along, across = np.stack([np.cos(angles), np.sin(angles)]), np.stack([-np.sin(angles), np.cos(angles)])
    origin = np.zeros((2, 1))
    turning = np.einsum("ia,ijp,ja->ap", across, flow.velocity_gradient(origin), along)
    elsewhere = np.einsum("ia,ijp,ja->ap", across, flow.velocity_gradient(POINTS.reshape(2, -1)), along)
    sense = np.sign(turning.flat[np.argmax(np.abs(turning))])
    turns_alike = sense != 0 and bool(np.all(sense * elsewhere >= -1e-14))
    assert turns_alike or not flow.rotates


@every_flow
def test_every_flow_names_its_rate(flow: ImposedFlow) -> None:
    assert flow.title
    assert set(flow.symbols) <= set(type(flow).model_fields)
    assert "rate" in flow.symbols
