"""Adhesion: minus the gradient of its energy, balanced between the vesicles, and exact at any gap."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from solver.forces.adhesion import DirectAdhesion
from solver.forces.pair_formulas import formula_and_parameters
from solver.forces.pair_sums import add_forces, pair_energy
from solver.membrane.geometry import Geometry, Membranes
from solver.potentials.neighbors import gap
from solver.potentials.proximity import Closeness
from solver.scene import Numerics, PowerLaw, Scene, Vesicle
from solver.simulation.initial_state import placed_state
from tests.solver.references import Ellipse, integrate, nearest_parameter
from tests.solver.scenes import geometry_of, smooth_direction, uneven_pair

Array = NDArray[np.float64]

EXPONENTS = [(3, 2), (4, 2), (5, 2), (4, 3), (7, 3), (8, 6), (9, 6), (12, 5), (12, 6), (11, 7)]


def density(scene: Scene, geometry: Geometry, accuracy: float = 1e-12) -> Array:
    assert scene.adhesion
    return DirectAdhesion(scene.adhesion, accuracy, geometry.membranes).density(geometry, Closeness(geometry))


def energy_of(adhesion: DirectAdhesion, scene: Scene) -> float:
    geometry = geometry_of(scene)
    return adhesion.energy(geometry, Closeness(geometry))


def total_force(geometry: Geometry, force: Array) -> Array:
    return np.sum(force.sum(axis=2) * geometry.membranes.spacing, axis=1)


def total_torque(geometry: Geometry, force: Array) -> float:
    torque = geometry.points[0] * force[1] - geometry.points[1] * force[0]
    return float(np.sum(torque.sum(axis=1) * geometry.membranes.spacing))


def magnitude(geometry: Geometry, force: Array) -> float:
    return float(np.sum(np.abs(force).sum(axis=(0, 2)) * geometry.membranes.spacing))


def trio(**fields: Any) -> Scene:
    """Three vesicles, each within reach of both others: gaps of 0.47, 0.27 and 0.33."""
    return uneven_pair(
        vesicles=(
            Vesicle(reduced_area=0.85, center=(-1.1, 0.1), angle=1.3),
            Vesicle(reduced_area=0.95, length=5.0, bending_modulus=2.5, center=(0.85, -0.2), angle=0.4),
            Vesicle(reduced_area=0.8, length=4.0, center=(0.6, 1.2), angle=0.6),
        ),
        **fields,
    )


@pytest.mark.parametrize("exponents", EXPONENTS)
def test_the_force_is_minus_the_gradient_of_the_energy(exponents: tuple[int, int]) -> None:
    """Work done along a deformation without stretching, against a fourth-order difference of the energy."""
    scene = uneven_pair(exponents=exponents, numerics=Numerics(points=128))
    geometry = geometry_of(scene)
    membranes, state = geometry.membranes, placed_state(scene)
    direction, step = smooth_direction(membranes), 2e-3
    assert scene.adhesion
    adhesion = DirectAdhesion(scene.adhesion, 1e-12, membranes)
    around = [Geometry(membranes, state + k * step * direction) for k in (-2, -1, 1, 2)]
    weights = np.array([1, -8, 8, -1]) / (12 * step)
    energy_change = weights @ [adhesion.energy(g, Closeness(g)) for g in around]
    displacement = np.tensordot(weights, [g.points for g in around], axes=1)
    work = np.sum(density(scene, geometry) * displacement * membranes.spacing[:, None])
    assert work == pytest.approx(-energy_change, rel=1e-7)
    assert abs(work) > 0.1


@pytest.mark.parametrize("exponents", EXPONENTS)
@pytest.mark.parametrize("distance_of_closest", [0.5, 3.0])
def test_the_force_is_exact_at_any_gap(exponents: tuple[int, int], distance_of_closest: float) -> None:
    """Against −∇∫φ integrated by brute force, at a gap of half a spacing and of three."""
    points, length = 192, 5.0
    minor = Ellipse.of(0.85, length).minor + Ellipse.of(0.9, 2 * np.pi).minor
    depth = minor + distance_of_closest * length / points
    scene = Scene(
        horizon=1.0,
        vesicles=(
            Vesicle(reduced_area=0.9, angle=0.0),
            Vesicle(reduced_area=0.85, length=length, angle=0.0, center=(0.03, -depth)),
        ),
        adhesion=PowerLaw(hamaker=1.7, distance=0.05, exponents=exponents),
        numerics=Numerics(points=points),
    )
    geometry = geometry_of(scene)
    source = Ellipse.of(0.85, length, complex(0.03, -depth), 0.0)
    m, n = exponents

    def force(offset: Array, alpha: Array) -> Array:
        r = np.hypot(*offset)
        return 1.7 * m * offset / r**2 * ((0.05 / r) ** m - (0.05 / r) ** n)

    computed = density(scene, geometry, 1e-11)[:, 0]
    targets = geometry.points[:, 0]
    rows = np.argsort(targets[1])[:10]
    exact = np.array(
        [integrate(source, force, targets[:, i], nearest_parameter(source, targets[:, i])) for i in rows]
    )
    assert np.max(np.abs(computed[:, rows] - exact.T)) < 1e-9 * np.max(np.abs(exact))


@pytest.mark.parametrize("exponents", [(4, 2), (12, 6), (5, 3)])
def test_forces_on_a_pair_balance(exponents: tuple[int, int]) -> None:
    scene = uneven_pair(exponents=exponents, numerics=Numerics(points=128))
    geometry = geometry_of(scene)
    force = density(scene, geometry)
    scale = magnitude(geometry, force)
    assert np.max(np.abs(total_force(geometry, force))) < 1e-12 * scale
    assert abs(total_torque(geometry, force)) < 1e-12 * scale


@pytest.mark.parametrize("exponents", [(4, 2), (12, 6), (5, 3)])
def test_forces_on_three_vesicles_balance(exponents: tuple[int, int]) -> None:
    adhesion = PowerLaw(hamaker=1.5, distance=0.3, exponents=exponents)
    scene = trio(adhesion=adhesion, numerics=Numerics(points=128))
    geometry = geometry_of(scene)
    force = density(scene, geometry)
    scale = magnitude(geometry, force)
    assert np.max(np.abs(total_force(geometry, force))) < 1e-11 * scale
    assert abs(total_torque(geometry, force)) < 1e-11 * scale
    each = np.abs(force.sum(axis=2)) * geometry.membranes.spacing
    assert np.all(each.max(axis=0) > 1e-3 * scale)  # every one is pushed by the others


def test_three_vesicles_feel_the_sum_of_their_pairs() -> None:
    scene = trio()
    geometry = geometry_of(scene)
    whole = density(scene, geometry)
    sums = np.zeros_like(whole)
    for pair in combinations(range(3), 2):
        part = scene.model_copy(update={"vesicles": tuple(scene.vesicles[k] for k in pair)})
        sums[:, list(pair)] += density(part, geometry_of(part))
    np.testing.assert_allclose(whole, sums, rtol=0, atol=1e-13 * np.max(np.abs(whole)))


def test_the_energy_counts_every_pair_once() -> None:
    scene = trio()
    assert scene.adhesion
    adhesion = DirectAdhesion(scene.adhesion, 1e-12, Membranes.of_scene(scene))
    parts = [
        energy_of(adhesion, scene.model_copy(update={"vesicles": (first, second)}))
        for first, second in combinations(scene.vesicles, 2)
    ]
    assert energy_of(adhesion, scene) == pytest.approx(sum(parts), rel=1e-14)


def test_the_energy_of_a_pair_against_brute_force() -> None:
    """H∫∫φ over the angles of two ellipses, trapezoid rule, which converges geometrically."""
    scene = uneven_pair(hamaker=1.3, numerics=Numerics(points=128))
    assert scene.adhesion
    alpha = 2 * np.pi * np.arange(800) / 800
    first, second = (
        Ellipse.of(v.reduced_area, v.length, complex(*v.center), v.angle) for v in scene.vesicles
    )
    offset = first.points(alpha)[:, :, None] - second.points(alpha)[:, None]
    q = scene.adhesion.distance / np.hypot(*offset)
    weight = 2 * np.pi / 800
    exact = 1.3 * weight**2 * first.speed(alpha) @ (q**4 - 2 * q**2) @ second.speed(alpha)
    energy = energy_of(DirectAdhesion(scene.adhesion, 1e-12, Membranes.of_scene(scene)), scene)
    assert energy == pytest.approx(exact, rel=1e-11)


def test_closer_than_the_distance_repels_and_farther_attracts() -> None:
    """Unit circles; the net force along the line of centers."""
    for separation, sign in ((0.15, -1), (0.6, 1)):
        scene = Scene(
            horizon=1.0,
            vesicles=(
                Vesicle(reduced_area=1.0),
                Vesicle(reduced_area=1.0, center=(2 + separation, 0.0)),
            ),
            adhesion=PowerLaw(hamaker=1.0, distance=0.4),
        )
        geometry = geometry_of(scene)
        assert gap(geometry) == pytest.approx(separation, abs=1e-3)
        assert np.sign(density(scene, geometry)[0, 0].sum()) == sign


@pytest.mark.parametrize("exponents", EXPONENTS)
@pytest.mark.parametrize("points", [64, 32])
def test_the_jacobian_is_exact(exponents: tuple[int, int], points: int) -> None:
    """Against fourth-order differences of the force, along a smooth direction and along single unknowns.

    At 32 points the nearest ones are refined.
    """
    scene = uneven_pair(exponents=exponents, numerics=Numerics(points=points))
    state = placed_state(scene)
    geometry = geometry_of(scene)
    membranes = geometry.membranes
    assert scene.adhesion
    adhesion = DirectAdhesion(scene.adhesion, 1e-6, membranes)
    random = np.random.default_rng(0)
    directions = [smooth_direction(membranes), *np.eye(len(state))[random.integers(0, len(state), 4)]]
    directions += list(np.eye(len(state))[-4:])
    step = 1e-3

    def differences(direction: Array) -> Array:
        around = [Geometry(membranes, state + k * step * direction) for k in (-2, -1, 1, 2)]
        forces = [adhesion.density(g, Closeness(g)) for g in around]
        return np.tensordot(np.array([1, -8, 8, -1]) / (12 * step), forces, axes=1)

    jacobian_x, jacobian_y = adhesion.jacobian(geometry, Closeness(geometry))
    for direction in directions:
        force = differences(direction)
        scale = np.max(np.abs(force))
        np.testing.assert_allclose(jacobian_x @ direction, force[0].ravel(), rtol=0, atol=1e-7 * scale)
        np.testing.assert_allclose(jacobian_y @ direction, force[1].ravel(), rtol=0, atol=1e-7 * scale)


@pytest.mark.parametrize(
    ("exponents", "separation", "energy"),
    [
        ((4, 2), (0.8660254, 5e-8), (-4.8368, 5e-5)),
        ((8, 6), (0.9354143, 5e-8), (-0.62666, 5e-6)),
        ((12, 6), (0.94713, 5e-6), (-1.68623, 5e-6)),
    ],
)
def test_parallel_lines(
    exponents: tuple[int, int], separation: tuple[float, float], energy: tuple[float, float]
) -> None:
    """Equilibrium of two infinite parallel lines: separation/δ and energy per length over H·δ.

    Independent values, to their last digit, by integrating the potential along a line.
    """
    distance, spacing, count = 0.4, 0.04, 20_000
    x = spacing * np.arange(-count, count + 1)
    end = (count + 0.5) * spacing
    line = np.stack([x, np.zeros_like(x)])
    m, n = exponents
    law = formula_and_parameters(PowerLaw(hamaker=1.0, distance=distance, exponents=exponents))
    weights = np.full(x.size, spacing)

    def pull(d: float) -> float:
        force = np.zeros((2, 1))
        add_forces(*law, np.array([[0.0], [d]]), line, weights, 1.0, force)
        return float(force[1, 0])

    equilibrium = brentq(pull, 0.7 * distance, 1.2 * distance, xtol=1e-13)
    assert equilibrium / distance == pytest.approx(separation[0], abs=separation[1])
    near = pair_energy(*law, np.array([[0.0], [equilibrium]]), line, weights)
    beyond = -2 * m / n * distance**n * end ** (1 - n) / (n - 1)  # the attraction of the ends left out
    assert (near + beyond) / distance == pytest.approx(energy[0], abs=energy[1])
