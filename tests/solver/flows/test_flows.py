"""Imposed flows have the velocities that the scene names, exact gradients and Jacobians, and true facts."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.flows import FLOWS, Extension, ImposedFlow, Linear, Shear, Trap

Array = NDArray[np.float64]
RANDOM = np.random.default_rng(5)
POINTS = 3 * RANDOM.standard_normal((2, 4, 7))
CENTERS = RANDOM.standard_normal((2, 3))

FLOW_TYPES = (-1.0, -0.4, 0.0, 0.3, 1.0)
LINEAR = [Linear(rate=0.7, flow_type=flow_type) for flow_type in FLOW_TYPES]
MANY = [*(flow(rate=0.7) for flow in FLOWS), *LINEAR, *(each.comoving for each in LINEAR if each.comoving)]
every_flow = pytest.mark.parametrize("flow", MANY, ids=lambda flow: flow.kind)


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


def test_a_linear_flow_of_type_1_is_extension() -> None:
    linear, extension = Linear(rate=0.7, flow_type=1.0), Extension(rate=0.7)
    assert np.array_equal(linear.velocity(POINTS, CENTERS), extension.velocity(POINTS, CENTERS))
    assert linear.comoving
    assert extension.comoving
    np.testing.assert_allclose(
        linear.comoving.velocity(POINTS, CENTERS),
        extension.comoving.velocity(POINTS, CENTERS),
        rtol=0,
        atol=1e-14,
    )


def test_a_linear_flow_of_type_0_is_shear_along_x_equal_to_y() -> None:
    along, across = np.array([1.0, 1.0]) / np.sqrt(2), np.array([-1.0, 1.0]) / np.sqrt(2)
    height = np.einsum("i,ijk->jk", across, POINTS)
    expected = 0.7 * height * along[:, None, None]
    np.testing.assert_allclose(Linear(rate=0.7).velocity(POINTS, CENTERS), expected, rtol=0, atol=1e-14)


def test_a_linear_flow_of_type_minus_1_turns_clockwise() -> None:
    x, y = POINTS
    rotation = Linear(rate=0.7, flow_type=-1.0)
    np.testing.assert_allclose(rotation.velocity(POINTS, CENTERS), [0.7 * y, -0.7 * x], rtol=1e-15)
    assert not rotation.shear_rate


@pytest.mark.parametrize("flow", LINEAR, ids=lambda flow: str(flow.flow_type))
def test_strain_and_rotation_of_a_linear_flow(flow: Linear) -> None:
    gradient = flow.velocity_gradient(np.zeros(2))
    strain = (gradient + gradient.T) / 2
    assert flow.rate_of_strain + flow.angular_velocity == pytest.approx(flow.rate, rel=1e-15)
    assert flow.rate_of_strain - flow.angular_velocity == pytest.approx(flow.flow_type * flow.rate, abs=1e-15)
    np.testing.assert_allclose(strain, flow.rate_of_strain * np.diag([-1, 1]), atol=1e-15)
    assert (gradient[0, 1] - gradient[1, 0]) / 2 == pytest.approx(flow.angular_velocity, abs=1e-15)
    assert flow.shear_rate == pytest.approx(np.sqrt(2 * np.sum(strain**2)), abs=1e-15)


@pytest.mark.parametrize("flow_type", [-0.4, 0.0, 0.3])
def test_the_aspect_ratio_is_that_of_the_rigid_ellipse_with_the_period(flow_type: float) -> None:
    """Its angle is integrated around the circle (Jeffery 1922)."""
    flow, ratio = Linear(rate=0.7, flow_type=flow_type), 1.6
    slenderness = (ratio**2 - 1) / (ratio**2 + 1)
    angle = 2 * np.pi * np.arange(400) / 400
    turning = flow.angular_velocity - slenderness * flow.rate_of_strain * np.sin(2 * angle)
    period = 2 * np.pi * np.mean(1 / turning)
    assert flow.effective_aspect_ratio(period) == pytest.approx(ratio, rel=1e-10)
    assert flow.effective_aspect_ratio(0.9 * 2 * np.pi / flow.angular_velocity) is None


def test_the_aspect_ratio_in_linear_flow_is_that_in_shear() -> None:
    in_shear = Shear(rate=0.7).effective_aspect_ratio(25.0)
    assert Linear(rate=0.7).effective_aspect_ratio(25.0) == pytest.approx(in_shear, rel=1e-12)
    assert Linear(rate=0.7, flow_type=1.0).effective_aspect_ratio(25.0) is None


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
    """Criteria read direction and sense from the gradient at the origin.  Strain may hold some lines."""
    angles = np.linspace(0, np.pi, 50)
    along, across = np.stack([np.cos(angles), np.sin(angles)]), np.stack([-np.sin(angles), np.cos(angles)])
    origin = np.zeros((2, 1))
    turning = np.einsum("ia,ijp,ja->ap", across, flow.velocity_gradient(origin), along)
    elsewhere = np.einsum("ia,ijp,ja->ap", across, flow.velocity_gradient(POINTS.reshape(2, -1)), along)
    sense = np.sign(turning.flat[np.argmax(np.abs(turning))])
    turns_alike = sense != 0 and bool(np.all(sense * elsewhere >= -1e-14))
    assert turns_alike or not flow.rotates or flow.strains
    assert sense * turning.sum() > 0 or not flow.rotates


@every_flow
def test_a_flow_that_strains_stretches_lines_along_y_fastest(flow: ImposedFlow) -> None:
    gradient = flow.velocity_gradient(np.zeros(2))
    assert np.allclose((gradient + gradient.T)[:, 1], [0, 2 * gradient[1, 1]]) or not flow.strains
    assert gradient[1, 1] > 0 or not flow.strains


@every_flow
def test_a_viscosity_divides_by_the_shear_rate_of_the_same_strain(flow: ImposedFlow) -> None:
    if flow.shear_rate is None:
        return
    gradient = flow.velocity_gradient(POINTS.reshape(2, -1))
    strain = (gradient + gradient.swapaxes(0, 1)) / 2
    np.testing.assert_allclose(np.sqrt(2 * np.sum(strain**2, axis=(0, 1))), flow.shear_rate, atol=1e-14)


@every_flow
def test_every_flow_names_its_rate(flow: ImposedFlow) -> None:
    assert flow.title
    assert set(flow.symbols) <= set(type(flow).model_fields)
    assert "rate" in flow.symbols
