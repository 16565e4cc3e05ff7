"""The bending force against its closed form on an ellipse, and as minus the gradient of the energy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad

from solver.forces.bending import Bending, bending_of
from solver.membrane.geometry import Geometry
from solver.scene import Numerics, Scene, Vesicle
from solver.simulation.initial_state import placed_state
from tests.solver.references import Ellipse
from tests.solver.scenes import geometry_of, smooth_direction, uneven_pair

Array = NDArray[np.float64]


def one(reduced_area: float, points: int, contrast: float = 1.0) -> tuple[Geometry, Ellipse, Array]:
    """A vesicle of modulus 2.5 and length 5, its ellipse, and the angles of its points on that."""
    vesicle = Vesicle(
        reduced_area=reduced_area,
        length=5.0,
        bending_modulus=2.5,
        viscosity_contrast=contrast,
        center=(1.0, 2.0),
        angle=0.8,
    )
    geometry = geometry_of(Scene(horizon=1.0, vesicles=(vesicle,), numerics=Numerics(points=points)))
    ellipse = Ellipse.of(reduced_area, 5.0, 1 + 2j, 0.8)
    return geometry, ellipse, ellipse.parameters(np.arctan2(*geometry.tangents[::-1, 0]))


def curvature(ellipse: Ellipse, alpha: Array) -> tuple[Array, Array, Array]:
    """Curvature k of an ellipse and its first two derivatives by arclength."""
    a, b = ellipse.major, ellipse.minor
    square = ellipse.speed(alpha) ** 2
    first = (a**2 - b**2) * np.sin(2 * alpha)  # d(square)/dα
    second = 2 * (a**2 - b**2) * np.cos(2 * alpha)
    k = a * b * square**-1.5
    k_s = -1.5 * a * b * square**-3 * first
    k_ss = -1.5 * a * b * square**-0.5 * (square**-3 * second - 3 * square**-4 * first**2)
    return k, k_s, k_ss


@pytest.mark.parametrize(("reduced_area", "points"), [(0.7, 384), (0.9, 160), (1.0, 32)])
def test_the_force_on_an_ellipse(reduced_area: float, points: int) -> None:
    """−κ x_ssss = −κ [(k_ss − k³) n − 3 k k_s t], from the Frenet equations."""
    geometry, ellipse, alpha = one(reduced_area, points)
    k, k_s, k_ss = curvature(ellipse, alpha)
    exact = -2.5 * ((k_ss - k**3) * geometry.normals[:, 0] - 3 * k * k_s * geometry.tangents[:, 0])
    error = np.max(np.abs(Bending().density(geometry)[:, 0] - exact))
    assert error < 2e-9 * np.max(np.abs(exact))


@pytest.mark.parametrize(("reduced_area", "points"), [(0.7, 256), (0.9, 128), (1.0, 32)])
def test_the_energy_of_an_ellipse(reduced_area: float, points: int) -> None:
    geometry, ellipse, _ = one(reduced_area, points)
    exact = quad(
        lambda a: 2.5 / 2 * curvature(ellipse, a)[0] ** 2 * ellipse.speed(a),
        0,
        2 * np.pi,
        epsabs=0,
        epsrel=1e-12,
    )[0]
    assert Bending().energy(geometry) == pytest.approx(exact, rel=1e-11)


def test_a_circle_of_radius_r_has_the_energy_pi_kappa_over_r() -> None:
    geometry, _, _ = one(1.0, 32)
    assert Bending().energy(geometry) == pytest.approx(2.5 * 2 * np.pi**2 / 5, rel=1e-14)


def test_the_force_is_minus_the_gradient_of_the_energy() -> None:
    """Work done along a deformation without stretching, against a fourth-order difference of the energy."""
    scene = uneven_pair(numerics=Numerics(points=128))
    geometry, state = geometry_of(scene), placed_state(scene)
    membranes, step = geometry.membranes, 1e-3
    direction = smooth_direction(membranes)
    # A displacement that closes the curve: the work of a force on an open one has end terms.
    for vesicle in range(2):
        tangents = geometry.tangents[:, vesicle]
        opening = np.stack([-tangents[1], tangents[0]], axis=1)
        block = slice(vesicle * 128, (vesicle + 1) * 128)
        direction[block] -= opening @ np.linalg.lstsq(opening, direction[block])[0]
    around = [Geometry(membranes, state + k * step * direction) for k in (-2, -1, 1, 2)]
    weights = np.array([1, -8, 8, -1]) / (12 * step)
    bending = Bending()
    energy_change = weights @ [bending.energy(g) for g in around]
    displacement = np.tensordot(weights, [g.points for g in around], axes=1)
    work = np.sum(bending.density(geometry) * displacement * membranes.spacing[:, None])
    assert work == pytest.approx(-energy_change, rel=1e-8)
    assert abs(work) > 0.1


def test_forces_and_torques_balance() -> None:
    geometry = geometry_of(uneven_pair(numerics=Numerics(points=128)))
    force = Bending().density(geometry) * geometry.membranes.spacing[:, None]
    torque = geometry.points[0] * force[1] - geometry.points[1] * force[0]
    assert np.max(np.abs(force.sum(axis=2))) < 1e-10 * np.max(np.abs(force))
    assert np.max(np.abs(torque.sum(axis=1))) < 1e-9 * np.max(np.abs(torque))


def test_the_jacobian_is_exact() -> None:
    """Against fourth-order differences, in every unknown."""
    scene = uneven_pair(numerics=Numerics(points=32))
    state, geometry = placed_state(scene), geometry_of(scene)
    membranes, bending, step = geometry.membranes, Bending(), 1e-3

    def force(shift: Array) -> Array:
        return bending.density(Geometry(membranes, state + shift))

    unknowns = np.eye(len(state)) * step
    exact = np.stack(
        [(force(-2 * d) - 8 * force(-d) + 8 * force(d) - force(2 * d)) / (12 * step) for d in unknowns],
        axis=-1,
    ).reshape(2, 64, len(state))
    jacobian = np.stack(bending.jacobian(geometry))
    np.testing.assert_allclose(jacobian, exact, rtol=0, atol=1e-9 * np.max(np.abs(exact)))


def test_a_circle_keeps_its_shape_by_a_tension_that_an_ellipse_does_not_have() -> None:
    """On a circle with a viscosity contrast it is a pressure; it pulls against a departure from it."""
    circle, _, _ = one(1.0, 32, contrast=2.0)
    rounding = bending_of(circle.membranes)
    pressure = rounding.density(circle) - Bending().density(circle)
    size = np.sum(pressure * circle.normals, axis=0)
    np.testing.assert_allclose(pressure, size.mean() * circle.normals, rtol=0, atol=1e-8 * size.mean())
    assert size.mean() > 1e5 * np.max(np.abs(Bending().density(circle)))
    ellipse, _, _ = one(0.9, 32)
    assert type(bending_of(ellipse.membranes)) is Bending


def test_the_jacobian_of_a_circle_is_exact() -> None:
    geometry, _, _ = one(1.0, 32, contrast=2.0)
    membranes, step = geometry.membranes, 1e-3
    bending, direction = bending_of(membranes), smooth_direction(membranes)
    state = membranes.pack(geometry.tangent_angle, geometry.centers.T)
    around = [bending.density(Geometry(membranes, state + k * step * direction)) for k in (-2, -1, 1, 2)]
    exact = np.tensordot(np.array([1, -8, 8, -1]) / (12 * step), around, axes=1).reshape(2, -1)
    computed = bending.jacobian(geometry) @ direction
    np.testing.assert_allclose(computed, exact, rtol=0, atol=1e-8 * np.max(np.abs(exact)))
