"""The single-layer potential against brute force: spectral on its own membrane and at any gap to another."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.membrane.geometry import Geometry
from solver.potentials.proximity import Closeness
from solver.potentials.single_layer import SingleLayer
from solver.scene import Numerics, Scene, Vesicle
from tests.solver.references import Ellipse, nearest_parameter, stokes_velocity
from tests.solver.scenes import geometry_of, uneven_pair

Array = NDArray[np.float64]


def density(alpha: Array) -> Array:
    """A smooth force density over the angle of an ellipse, with all harmonics and a mean."""
    return np.stack([np.exp(np.sin(alpha)), np.cos(2 * alpha + 0.4) + 0.5])


def ellipses(scene: Scene) -> list[Ellipse]:
    return [Ellipse.of(v.reduced_area, v.length, complex(*v.center), v.angle) for v in scene.vesicles]


def sampled_density(scene: Scene, geometry: Geometry, loaded: int) -> Array:
    """Point forces (2, M, N) of `density` on one vesicle alone."""
    forces = np.zeros_like(geometry.points)
    tangent_angle = np.arctan2(geometry.tangents[1, loaded], geometry.tangents[0, loaded])
    alpha = ellipses(scene)[loaded].parameters(tangent_angle)
    forces[:, loaded] = density(alpha) * geometry.membranes.spacing[loaded]
    return forces


def velocity(geometry: Geometry, forces: Array, accuracy: float = 1e-13) -> Array:
    layer = SingleLayer(geometry.membranes, accuracy)
    layer.assemble(geometry, Closeness(geometry) if geometry.membranes.count > 1 else None)
    return layer.velocity(forces)


def self_error(reduced_area: float, points: int) -> float:
    """Largest error on the ellipse itself over the largest velocity."""
    vesicle = Vesicle(reduced_area=reduced_area, length=5.0, center=(0.2, -0.1), angle=0.8)
    scene = Scene(horizon=1.0, vesicles=(vesicle,), numerics=Numerics(points=points))
    geometry = geometry_of(scene)
    (ellipse,) = ellipses(scene)
    computed = velocity(geometry, sampled_density(scene, geometry, 0))[:, 0]
    rows = range(0, points, points // 16)
    alpha = ellipse.parameters(np.arctan2(*geometry.tangents[::-1, 0]))
    exact = np.array([stokes_velocity(ellipse, density, geometry.points[:, 0, i], alpha[i]) for i in rows])
    return float(np.max(np.abs(computed[:, rows] - exact.T)) / np.max(np.abs(exact)))


def assert_spectral(errors: list[float]) -> None:
    """Down to 1e-12, each doubling of the points gaining more than the one before."""
    assert errors[-1] < 1e-12
    for coarse, fine in pairwise(errors):
        assert fine < max(coarse**1.4, 1e-12)


@pytest.mark.parametrize(("reduced_area", "points"), [(0.65, 512), (0.9, 128), (1.0, 64)])
def test_self_interaction_converges_spectrally(reduced_area: float, points: int) -> None:
    resolutions = [16 * 2**k for k in range(6) if 16 * 2**k <= points]
    assert_spectral([self_error(reduced_area, resolution) for resolution in resolutions])


def close_pair(points: int, gap_per_spacing: float) -> Scene:
    """Two ellipses, the second below the first, whose nearest points lie a given number of spacings apart."""
    upper = Vesicle(reduced_area=0.9, angle=0.0)
    lower = Vesicle(reduced_area=0.85, length=5.0, angle=0.0)
    shapes = [Ellipse.of(v.reduced_area, v.length) for v in (upper, lower)]
    gap = gap_per_spacing * lower.length / points
    depth = shapes[0].minor + shapes[1].minor + gap
    return Scene(
        horizon=1.0,
        vesicles=(upper, lower.model_copy(update={"center": (0.03, -depth)})),
        numerics=Numerics(points=points),
    )


def cross_error(points: int, gap_per_spacing: float, accuracy: float = 1e-13) -> float:
    """Largest error, over the largest velocity, that a force density on one vesicle causes on the other."""
    scene = close_pair(points, gap_per_spacing)
    geometry = geometry_of(scene)
    source = ellipses(scene)[1]
    computed = velocity(geometry, sampled_density(scene, geometry, 1), accuracy)[:, 0]
    targets = geometry.points[:, 0]
    rows = np.argsort(np.hypot(*(targets - geometry.points[:, 1].mean(axis=1)[:, None])))[:12]
    exact = np.array(
        [
            stokes_velocity(source, density, targets[:, i], nearest_parameter(source, targets[:, i]))
            for i in rows
        ]
    )
    return float(np.max(np.abs(computed[:, rows] - exact.T)) / np.max(np.abs(exact)))


@pytest.mark.parametrize("gap_per_spacing", [0.5, 1.0, 2.0, 5.0, 10.0])
def test_cross_interaction_converges_spectrally_at_any_gap(gap_per_spacing: float) -> None:
    assert_spectral([cross_error(points, gap_per_spacing) for points in (16, 32, 64, 128)])


@pytest.mark.parametrize("accuracy", [1e-4, 1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("gap_per_spacing", [0.5, 1.0, 2.0, 3.0])
def test_cross_interaction_is_as_accurate_as_asked(gap_per_spacing: float, accuracy: float) -> None:
    assert cross_error(128, gap_per_spacing, accuracy) < accuracy


def test_without_refinement_the_close_gap_would_be_wrong() -> None:
    """What the two tests above guard against: the same sums on the points themselves."""
    scene = close_pair(128, 0.5)
    geometry = geometry_of(scene)
    forces = sampled_density(scene, geometry, 1)
    layer = SingleLayer(geometry.membranes, 1e-13)
    layer.assemble(geometry, None)
    error = np.abs(layer.velocity(forces) - velocity(geometry, forces))
    assert np.max(error[:, 0]) > 1e-3


@pytest.mark.parametrize("loaded", [0, 1])
def test_the_potential_of_the_normal_is_zero(loaded: int) -> None:
    """A pressure in an incompressible fluid moves nothing, neither its own membrane nor another."""
    geometry = geometry_of(uneven_pair(numerics=Numerics(points=128)))
    forces = np.zeros_like(geometry.points)
    forces[:, loaded] = geometry.normals[:, loaded] * geometry.membranes.spacing[loaded]
    assert np.max(np.abs(velocity(geometry, forces))) < 1e-13


def test_the_flow_through_a_membrane_is_zero() -> None:
    geometry = geometry_of(uneven_pair(numerics=Numerics(points=128)))
    flow = velocity(geometry, geometry.points * geometry.membranes.spacing[:, None])
    through = np.sum(flow * geometry.normals, axis=(0, 2)) * geometry.membranes.spacing
    assert np.max(np.abs(through)) < 1e-12 * np.max(np.abs(flow))


def test_reciprocity() -> None:
    """Forces of one load work on the velocity of another as much as the other way round."""
    geometry = geometry_of(uneven_pair(numerics=Numerics(points=128)))
    alpha = 2 * np.pi * np.arange(128) / 128
    first = np.array([[np.cos(alpha), np.sin(2 * alpha)], [np.exp(np.cos(alpha)), np.ones(128)]])
    second = np.array([[np.sin(alpha), np.cos(3 * alpha)], [np.cos(2 * alpha), np.exp(np.sin(alpha))]])
    first = first * geometry.membranes.spacing[:, None]
    second = second * geometry.membranes.spacing[:, None]
    there = np.sum(first * velocity(geometry, second))
    back = np.sum(second * velocity(geometry, first))
    assert there == pytest.approx(back, rel=1e-12)
    assert np.sum(first * velocity(geometry, first)) > 0  # what the forces do is dissipated
