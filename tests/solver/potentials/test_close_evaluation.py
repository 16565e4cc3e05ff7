"""The potential close to a membrane against brute force, from ten spacings away down to its very points."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.membrane.curve import positions
from solver.membrane.geometry import Geometry, Membranes
from solver.membrane.shapes import ellipse_tangent_angle
from solver.membrane.spectral import differentiation, interpolation
from solver.potentials.close_evaluation import close_stokeslets, logarithm_correction
from solver.potentials.single_layer import SingleLayer
from solver.potentials.stokeslets import stokeslets
from solver.scene import Vesicle
from tests.solver.references import Ellipse, graded_nodes

Array = NDArray[np.float64]
Density = Callable[[Ellipse, Array], Array]

LENGTH, CENTER, ANGLE = 5.0, np.array([0.2, -0.1]), 0.8
GAPS = [10.0, 3.0, 1.0, 0.3, 0.05, 1e-3, 1e-6, 1e-10]  # in spacings


class Membrane:
    """A closed curve given by its tangent angles, and what a force density on it causes."""

    def __init__(self, tangent_angle: Array, length: float = LENGTH, center: Array = CENTER) -> None:
        self.size = tangent_angle.size
        self.spacing = length / self.size
        self.points = positions(tangent_angle, center, length)
        self.tangents = np.stack([np.cos(tangent_angle), np.sin(tangent_angle)])
        self.outward = np.stack([self.tangents[1], -self.tangents[0]])

    def components(self, targets: Array) -> Array:
        """By the close rule, (3, m, n)."""
        components = np.empty((3, targets.shape[1], self.size))
        tables = logarithm_correction(self.size), differentiation(self.size)
        close_stokeslets(targets, self.points, self.tangents, self.spacing, *tables, components)
        return components

    def refined_components(self, targets: Array, factor: int) -> Array:
        """By the trapezoid rule on ``factor`` times as many points, (3, m, n)."""
        matrix = interpolation(self.size, factor)
        components = np.empty((3, targets.shape[1], factor * self.size))
        stokeslets(targets, self.points @ matrix.T, components)
        return np.asarray(components @ matrix) / factor

    def velocity(self, targets: Array, density: Array) -> Array:
        return applied(self.components(targets), density * self.spacing)


def applied(components: Array, point_forces: Array) -> Array:
    xx, xy, yy = components
    fx, fy = point_forces
    return np.stack([xx @ fx + xy @ fy, xy @ fx + yy @ fy])


def smooth(ellipse: Ellipse, alpha: Array) -> Array:
    """A force density with all harmonics and a mean."""
    return np.stack([np.exp(np.sin(alpha)), np.cos(2 * alpha + 0.4) + 0.5])


def like_bending(ellipse: Ellipse, alpha: Array) -> Array:
    """Powers of the curvature times the normal and the tangent: concentrated at the tips, as bending is."""
    speed = ellipse.speed(alpha)
    curvature = ellipse.major * ellipse.minor / speed**3
    normal = outward(ellipse, alpha)
    return curvature**3 * normal + curvature**2 * np.stack([-normal[1], normal[0]])


def outward(ellipse: Ellipse, alpha: Array) -> Array:
    """Unit normals of an ellipse, (2, n)."""
    normal = np.exp(1j * ellipse.angle) * (ellipse.minor * np.cos(alpha) + 1j * ellipse.major * np.sin(alpha))
    return np.stack([normal.real, normal.imag]) / ellipse.speed(alpha)


def exact_velocity(ellipse: Ellipse, density: Density, target: Array, nearest: float) -> Array:
    """`references.stokes_velocity` with more nodes: its 24 a panel are not enough for an aspect of 1 to 5."""
    alpha, weight = graded_nodes(nearest, order=96)
    offset = target[:, None] - ellipse.points(alpha)
    r2 = np.maximum(np.sum(offset**2, axis=0), 1e-34)
    f = density(ellipse, alpha)
    integrand = -0.5 * np.log(r2) * f + offset * np.sum(offset * f, axis=0) / r2
    return np.asarray(integrand @ (weight * ellipse.speed(alpha))) / (4 * np.pi)


def ellipse_and_membrane(reduced_area: float, points: int) -> tuple[Ellipse, Membrane, Array]:
    """An ellipse, its discretization, and the ellipse's parameters at the points."""
    ellipse = Ellipse.of(reduced_area, LENGTH, complex(*CENTER), ANGLE)
    tangent_angle = ellipse_tangent_angle(reduced_area, LENGTH, ANGLE, points)
    return ellipse, Membrane(tangent_angle), ellipse.parameters(tangent_angle)


def error(reduced_area: float, points: int, gap: float, density: Density) -> float:
    """Largest error over the largest velocity, at targets around an ellipse, ``gap`` spacings from it."""
    ellipse, membrane, parameters = ellipse_and_membrane(reduced_area, points)
    nearest = np.concatenate([np.linspace(0.0, 6.2, 7), parameters[[3, points // 4]]])  # some opposite points
    targets = ellipse.points(nearest) + gap * membrane.spacing * outward(ellipse, nearest)
    computed = membrane.velocity(targets, density(ellipse, parameters))
    pairs = zip(targets.T, nearest, strict=True)
    exact = np.array([exact_velocity(ellipse, density, target, at) for target, at in pairs])
    return float(np.max(np.abs(computed.T - exact)) / np.max(np.abs(exact)))


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize(
    ("reduced_area", "points", "density"),
    [
        (1.0, 64, smooth),
        (0.95, 64, smooth),
        (0.9, 96, smooth),
        (0.9, 128, smooth),
        (0.9, 128, like_bending),
        (0.65, 384, smooth),
        (0.5, 640, smooth),
        (0.5, 1024, like_bending),
    ],
)
def test_any_gap_is_as_good_as_another(
    reduced_area: float, points: int, density: Density, gap: float
) -> None:
    assert error(reduced_area, points, gap, density) < 1e-10


@pytest.mark.parametrize("gap", [3.0, 0.3, 0.05, 1e-6])
@pytest.mark.parametrize(("reduced_area", "points"), [(0.5, 1024), (0.65, 512), (0.9, 128), (1.0, 32)])
def test_convergence_is_spectral(reduced_area: float, points: int, gap: float) -> None:
    """Down to 1e-12, each doubling of the points gains more than the one before."""
    resolutions = [16 * 2**k for k in range(7) if 16 * 2**k <= points]
    errors = [error(reduced_area, resolution, gap, smooth) for resolution in resolutions]
    assert errors[-1] < 1e-12
    for coarse, fine in pairwise(errors):
        assert fine < max(coarse**1.3, 1e-12)


def test_refinement_alone_would_be_wrong() -> None:
    """What the rule is for: a twentieth of a spacing away, 32 times as many points do not suffice."""
    ellipse, membrane, parameters = ellipse_and_membrane(0.9, 128)
    targets = membrane.points + 0.05 * membrane.spacing * membrane.outward
    forces = smooth(ellipse, parameters) * membrane.spacing
    refined = applied(membrane.refined_components(targets, 32), forces)
    assert np.max(np.abs(refined - applied(membrane.components(targets), forces))) > 1e-8


def lobed(points: int, lobes: int, depth: float) -> tuple[Membrane, Array]:
    """A curve with dents, resolved by few points, and a density on it."""
    s = 2 * np.pi * np.arange(points) / points
    assert lobes * depth > 1  # somewhere the curvature is negative
    density = np.stack([np.exp(np.sin(s)), np.cos(2 * s + 0.4) + 0.5])
    return Membrane(s + depth * np.sin(lobes * s), 2 * np.pi), density


@pytest.mark.parametrize(("lobes", "depth"), [(2, 0.8), (3, 0.6), (3, 0.8)])
@pytest.mark.parametrize("gap", [1.0, 0.3])
def test_dents(lobes: int, depth: float, gap: float) -> None:
    membrane, density = lobed(64, lobes, depth)
    targets = membrane.points + gap * membrane.spacing * membrane.outward
    refined = applied(membrane.refined_components(targets, 64), density * membrane.spacing)
    computed = membrane.velocity(targets, density)
    assert np.max(np.abs(computed - refined)) < 1e-13 * np.max(np.abs(refined))


@pytest.mark.parametrize("gap", GAPS)
def test_the_potential_of_the_normal_is_zero(gap: float) -> None:
    """A pressure in an incompressible fluid moves nothing outside."""
    _, ellipse, _ = ellipse_and_membrane(0.8, 256)
    for membrane in (ellipse, lobed(64, 2, 0.8)[0]):
        targets = membrane.points + gap * membrane.spacing * membrane.outward
        assert np.max(np.abs(membrane.velocity(targets, membrane.outward))) < 1e-13


def on_the_membrane(points: int) -> tuple[Membrane, Array, Array]:
    """A membrane, a density, and the velocity that `SingleLayer` finds at the membrane's points."""
    ellipse, membrane, parameters = ellipse_and_membrane(0.9, points)
    membranes = Membranes.of([Vesicle(reduced_area=0.9, length=LENGTH)], points)
    tangent_angle = ellipse_tangent_angle(0.9, LENGTH, ANGLE, points)
    geometry = Geometry(membranes, membranes.pack(tangent_angle[None], CENTER[None]))
    layer = SingleLayer(membranes, 1e-13)
    layer.assemble(geometry, None)
    density = smooth(ellipse, parameters)
    return membrane, density, layer.velocity(density[:, None] * membrane.spacing)[:, 0]


@pytest.mark.parametrize("distance", [0.0, 1e-300, 1e-16, 1e-15, 1e-14])
@pytest.mark.parametrize("direction", [0.0, np.pi / 2, 2.0])
def test_practically_on_a_point(distance: float, direction: float) -> None:
    """Kress's rule holds on the points themselves, and the potential is continuous."""
    membrane, density, expected = on_the_membrane(128)
    step = distance * np.array([np.cos(direction), np.sin(direction)])
    computed = membrane.velocity(membrane.points + step[:, None], density)
    assert np.max(np.abs(computed - expected)) < 1e-12 * np.max(np.abs(expected))


def test_the_potential_is_continuous() -> None:
    """It approaches the values on the membrane linearly."""
    membrane, density, expected = on_the_membrane(128)
    for gap in (1e-2, 1e-4, 1e-6, 1e-8):
        targets = membrane.points + gap * membrane.outward
        jump = np.max(np.abs(membrane.velocity(targets, density) - expected))
        assert jump < gap * np.max(np.abs(density)) + 1e-12


def test_far_away_the_plain_rule_is_as_good() -> None:
    ellipse, membrane, parameters = ellipse_and_membrane(0.9, 128)
    targets = membrane.points[:, ::8] + 10 * membrane.spacing * membrane.outward[:, ::8]
    plain = np.empty((3, targets.shape[1], membrane.size))
    stokeslets(targets, membrane.points, plain)
    forces = smooth(ellipse, parameters) * membrane.spacing
    expected = applied(plain, forces)
    computed = applied(membrane.components(targets), forces)
    assert np.max(np.abs(computed - expected)) < 1e-12 * np.max(np.abs(expected))


@pytest.mark.parametrize("gap", [2.0, 0.05, 1e-6])
def test_moved_and_turned_with_its_targets(gap: float) -> None:
    """The components turn like a tensor, and where the scene is does not matter."""
    angle, shift = 0.7, np.array([3.0, -2.0])
    tangent_angle = ellipse_tangent_angle(0.9, LENGTH, ANGLE, 64)
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    membrane = Membrane(tangent_angle)
    moved = Membrane(tangent_angle + angle, center=rotation @ CENTER + shift)
    # Away from the points' own normals, so that the nearest one is never a matter of rounding.
    offset = gap * membrane.outward + 0.2 * membrane.tangents
    targets = membrane.points + membrane.spacing * offset
    xx, xy, yy = membrane.components(targets)
    turned = np.einsum("ij,jk...,lk->il...", rotation, np.array([[xx, xy], [xy, yy]]), rotation)
    moved_xx, moved_xy, moved_yy = moved.components(rotation @ targets + shift[:, None])
    expected = np.array([[moved_xx, moved_xy], [moved_xy, moved_yy]])
    assert np.max(np.abs(turned - expected)) < 1e-12 * np.max(np.abs(expected))


def test_one_target_at_a_time() -> None:
    """The rows do not depend on each other, nor on how the arrays lie in memory."""
    _, membrane, _ = ellipse_and_membrane(0.9, 64)
    targets = membrane.points + 0.1 * membrane.spacing * membrane.outward
    together = membrane.components(targets)
    membrane.points = np.asfortranarray(membrane.points)
    membrane.tangents = np.asfortranarray(membrane.tangents)
    alone = np.concatenate([membrane.components(targets[:, [i]]) for i in range(64)], axis=1)
    assert np.max(np.abs(alone - together)) < 1e-13 * np.max(np.abs(together))
