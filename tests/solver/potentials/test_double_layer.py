"""The double-layer potential: its jumps, Green's formula with a known flow, brute force at any gap."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.membrane.geometry import Geometry, Membranes
from solver.potentials.double_layer import DoubleLayer
from solver.potentials.proximity import Closeness
from solver.potentials.single_layer import SingleLayer
from solver.scene import Numerics, Scene, Vesicle
from solver.simulation.initial_state import placed_state
from tests.solver.references import Ellipse, integrate, nearest_parameter
from tests.solver.scenes import closing, geometry_of, shear_pair, smooth_direction, uneven_pair

Array = NDArray[np.float64]


def layers(geometry: Geometry) -> tuple[SingleLayer, DoubleLayer]:
    closeness = Closeness(geometry) if geometry.membranes.curves > 1 else None
    single, double = SingleLayer(geometry.membranes, 1e-12), DoubleLayer(geometry.membranes, 1e-12)
    single.assemble(geometry, closeness)
    double.assemble(geometry, closeness, single.matrix)
    return single, double


def potential(double: DoubleLayer, values: Array) -> Array:
    return (double.matrix @ values.ravel()).reshape(values.shape)


def rigid_motions(geometry: Geometry) -> list[Array]:
    x, y = geometry.points
    return [np.stack([np.ones_like(x), 0 * x]), np.stack([0 * x, np.ones_like(x)]), np.stack([-y, x])]


@pytest.mark.parametrize("reduced_area", [1.0, 0.8, 0.4])
@pytest.mark.parametrize("points", [16, 64])
def test_rigid_motions_jump_exactly_however_few_the_points(reduced_area: float, points: int) -> None:
    vesicle = Vesicle(reduced_area=reduced_area, center=(0.3, -2.0), angle=0.7)
    geometry = geometry_of(
        Scene(horizon=1.0, vesicles=(vesicle,), numerics=Numerics.model_construct(points=points))
    )
    _, double = layers(geometry)
    for motion in rigid_motions(geometry):
        np.testing.assert_allclose(potential(double, motion), -0.5 * motion, rtol=0, atol=1e-13)


@pytest.mark.parametrize("gap", [3.0, 1.0, 0.1, 1e-3])
def test_rigid_motions_of_one_vesicle_move_no_other(gap: float) -> None:
    geometry = geometry_of(stacked(gap))
    _, double = layers(geometry)
    for motion in rigid_motions(geometry):
        motion[:, 0] = 0.0
        np.testing.assert_allclose(potential(double, motion)[:, 0], 0, rtol=0, atol=1e-11)


def stacked(gap: float, points: int = 128) -> Scene:
    """Two lying ellipses, one below the other, with a gap in spacings of the lower one."""
    depth = Ellipse.of(0.85, 5.0).minor + Ellipse.of(0.9, 2 * np.pi).minor + gap * 5.0 / points
    lower = Vesicle(reduced_area=0.85, length=5.0, angle=0.0, center=(0.03, -depth))
    upper = Vesicle(reduced_area=0.9, angle=0.0)
    return Scene(horizon=1.0, vesicles=(upper, lower), numerics=Numerics(points=points))


@pytest.mark.parametrize("gap", [10.0, 2.0, 0.3, 0.01])
def test_the_potential_on_another_vesicle_is_exact_at_any_gap(gap: float) -> None:
    """Against the integral by brute force, of a density with all harmonics."""
    scene = stacked(gap)
    geometry = geometry_of(scene)
    source = Ellipse.of(0.85, 5.0, complex(*scene.vesicles[1].center))

    def values(alpha: Array) -> Array:
        return np.stack([np.exp(np.sin(alpha)), np.cos(2 * alpha + 0.4) + 0.5])

    def integrand(offset: Array, alpha: Array) -> Array:
        normal = np.stack([source.minor * np.cos(alpha), source.major * np.sin(alpha)]) / source.speed(alpha)
        across, along = np.sum(offset * normal, axis=0), np.sum(offset * values(alpha), axis=0)
        return offset * across * along / np.sum(offset**2, axis=0) ** 2 / np.pi

    density = np.zeros_like(geometry.points)
    density[:, 1] = values(source.parameters(geometry.tangent_angle[1]))
    _, double = layers(geometry)
    computed = potential(double, density)[:, 0]
    targets = geometry.points[:, 0]
    rows = np.argsort(targets[1])[:6]
    exact = [
        integrate(source, integrand, targets[:, i], nearest_parameter(source, targets[:, i])) for i in rows
    ]
    np.testing.assert_allclose(computed[:, rows].T, exact, rtol=0, atol=1e-9)


def green_error(points: int) -> float:
    """How far Green's formula for a flow inside, ½u = S(σ·n) − D u, is from holding.

    u = (y², 0) with the pressure 2x.
    """
    vesicle = Vesicle(reduced_area=0.8, center=(0.2, 0.1), angle=0.5)
    geometry = geometry_of(Scene(horizon=1.0, vesicles=(vesicle,), numerics=Numerics(points=points)))
    single, double = layers(geometry)
    x, y = geometry.points
    outward_x, outward_y = -geometry.normals
    traction = np.stack([-2 * x * outward_x + 2 * y * outward_y, 2 * y * outward_x - 2 * x * outward_y])
    flow = np.stack([y**2, 0 * y])
    spacing = geometry.membranes.spacing[:, None]
    return float(np.max(np.abs(single.velocity(traction * spacing) - potential(double, flow) - flow / 2)))


def test_greens_formula_holds_with_spectral_accuracy() -> None:
    errors = [green_error(points) for points in (32, 64, 128)]
    assert errors[0] < 1e-2
    assert errors[1] < 0.02 * errors[0]
    assert errors[2] < 1e-3 * errors[1]


def test_images_carry_the_opposite() -> None:
    half, whole = shear_pair(1.0), shear_pair(1.0)
    first, second = whole.vesicles
    shifted = second.model_copy(update={"center": (second.center[0] + 1e-13, 0.0)})
    whole = whole.model_copy(update={"vesicles": (first, shifted)})
    (_, folded), (_, full) = layers(geometry_of(half)), layers(geometry_of(whole))
    points = geometry_of(half).points
    assert points.shape[1] == 1
    values = np.stack([np.exp(points[1]), np.cos(points[0])])
    # The second ellipse is placed half turned against an image: its points begin at the opposite end.
    both = np.concatenate([values, -np.roll(values, values.shape[-1] // 2, axis=-1)], axis=1)
    np.testing.assert_allclose(
        potential(folded, values)[:, 0], potential(full, both)[:, 0], rtol=0, atol=1e-10
    )


@pytest.mark.parametrize("scene", [uneven_pair(), shear_pair(1.0)], ids=["two", "image"])
def test_the_jacobian_is_exact(scene: Scene) -> None:
    """Against fourth-order differences at a fixed density, along deformations that keep the curves closed."""
    scene = scene.model_copy(update={"numerics": Numerics(points=96)})
    membranes, state, step = Membranes.of_scene(scene), placed_state(scene), 1e-3
    alpha = 2 * np.pi * np.arange(96) / 96
    phases = np.arange(membranes.count)[:, None]
    density = np.stack([np.exp(np.sin(alpha + phases)), np.cos(2 * alpha - phases)])

    def at(state: Array) -> Array:
        return potential(layers(Geometry(membranes, state))[1], density).reshape(2, -1)

    jacobian = layers(Geometry(membranes, state))[1].jacobian(Geometry(membranes, state), density)
    for direction in (smooth_direction(membranes, seed) for seed in (0, 1)):
        direction = closing(membranes, state, direction)
        around = [at(state + k * step * direction) for k in (-2, -1, 1, 2)]
        exact = np.tensordot(np.array([1, -8, 8, -1]) / (12 * step), around, axes=1)
        # To second order the curves open, and where they do the potential jumps with the nearest point.
        np.testing.assert_allclose(jacobian @ direction, exact, rtol=0, atol=1e-6 * np.max(np.abs(exact)))
