"""The tension makes the membranes inextensible, and is found whatever their shapes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.forces.tension import ROUND_OFF, Inextensibility
from solver.membrane.geometry import Geometry
from solver.potentials.proximity import Closeness
from solver.potentials.single_layer import SingleLayer
from solver.potentials.viscosity_contrast import ViscosityContrast
from solver.scene import Numerics, Scene, Vesicle
from solver.simulation.initial_state import placed_state
from tests.solver.scenes import geometry_of, smooth_direction, uneven_pair

Array = NDArray[np.float64]


def layer_of(geometry: Geometry) -> SingleLayer:
    layer = SingleLayer(geometry.membranes, 1e-12)
    layer.assemble(geometry, Closeness(geometry) if geometry.membranes.count > 1 else None)
    return layer


def caused_velocity(layer: SingleLayer, geometry: Geometry, tension: Array) -> Array:
    """S (σ x_s)_s."""
    force = geometry.arclength_derivative(tension * geometry.tangents)
    return layer.velocity(force * geometry.membranes.spacing[:, None])


def stretching(geometry: Geometry, velocity: Array) -> Array:
    return np.sum(geometry.tangents * geometry.arclength_derivative(velocity), axis=0)


def smooth_tension(geometry: Geometry) -> Array:
    """One with a mean and several waves, different on every vesicle, (M, N)."""
    alpha = 2 * np.pi * np.arange(geometry.membranes.points) / geometry.membranes.points
    waves = np.exp(np.sin(alpha)) + 0.3 * np.cos(5 * alpha)
    return np.array([(k + 1) * waves - 2.0 * k for k in range(geometry.membranes.count)])


def circle_beside_an_ellipse() -> Scene:
    vesicles = (Vesicle(reduced_area=1.0, center=(-1.5, 0.0)), Vesicle(reduced_area=0.8, center=(1.0, 0.3)))
    return Scene(horizon=1.0, vesicles=vesicles)


@pytest.mark.parametrize(
    "scene",
    [
        uneven_pair(),
        Scene(horizon=1.0, vesicles=(Vesicle(reduced_area=0.6),), numerics=Numerics(points=128)),
    ],
    ids=["two", "one"],
)
def test_a_known_tension_is_found(scene: Scene) -> None:
    """The velocity that a tension causes is cancelled by its negative."""
    geometry = geometry_of(scene)
    layer, tension = layer_of(geometry), smooth_tension(geometry)
    velocity = caused_velocity(layer, geometry, tension)
    found, _ = Inextensibility(1e-13, ROUND_OFF).solve(layer, geometry, velocity)
    np.testing.assert_allclose(found.tension, -tension, rtol=0, atol=1e-8 * np.max(np.abs(tension)))
    np.testing.assert_allclose(found.velocity, 0, rtol=0, atol=1e-10 * np.max(np.abs(velocity)))


@pytest.mark.parametrize("scene", [uneven_pair(), circle_beside_an_ellipse()], ids=["ellipses", "circle"])
def test_nothing_stretches(scene: Scene) -> None:
    geometry = geometry_of(scene)
    layer = layer_of(geometry)
    x, y = geometry.points
    imposed = np.stack([y**2, 0.3 * x**2])  # without divergence: a circle cannot swell
    before = stretching(geometry, imposed)
    (tension, velocity, rotation_rate), _ = Inextensibility(1e-12, ROUND_OFF).solve(layer, geometry, imposed)
    assert np.max(np.abs(before)) > 0.1
    assert np.max(np.abs(stretching(geometry, velocity))) < 1e-11
    correction = velocity - imposed
    np.testing.assert_allclose(caused_velocity(layer, geometry, tension), correction, rtol=0, atol=1e-11)
    normal_change = np.sum(geometry.normals * geometry.arclength_derivative(velocity), axis=0)
    np.testing.assert_allclose(rotation_rate, normal_change, rtol=0, atol=1e-12)


def test_the_tension_of_a_circle_in_shear() -> None:
    """In closed form, from the stream functions inside and outside a circle of radius R.

    The tension −gR sin 2φ of shear with rate g drives −(gR/4) cos 2φ along the membrane, nothing across.
    A constant tension acts as a pressure and is not determined.
    """
    rate, length = 0.7, 5.0
    vesicle = Vesicle(reduced_area=1.0, length=length)
    geometry = geometry_of(Scene(horizon=1.0, vesicles=(vesicle,), numerics=Numerics(points=32)))
    imposed = np.stack([rate * geometry.points[1], np.zeros((1, 32))])
    found, _ = Inextensibility(1e-13, ROUND_OFF).solve(layer_of(geometry), geometry, imposed)
    tension, velocity, _ = found
    phi, radius = np.arctan2(*geometry.points[::-1]), length / (2 * np.pi)
    exact = -rate * radius / 4 * np.cos(2 * phi) * geometry.tangents
    np.testing.assert_allclose(velocity - imposed, exact, rtol=0, atol=1e-12)
    np.testing.assert_allclose(tension - tension.mean(), -rate * radius * np.sin(2 * phi), rtol=0, atol=1e-11)


@pytest.mark.parametrize("points", [32, 64, 128])
@pytest.mark.parametrize("contrast", [1e-4, 1e-2, 0.5, 30.0, 1e4, 1e6])
def test_the_mean_tension_of_a_circle_is_projected_out(contrast: float, points: int) -> None:
    """No eigenvalue of the operator is round-off, whatever the viscosity inside."""
    vesicle = Vesicle(reduced_area=1.0, viscosity_contrast=contrast)
    scene = Scene(horizon=1.0, vesicles=(vesicle,), numerics=Numerics(points=points))
    geometry = geometry_of(scene)
    layer = layer_of(geometry)
    mobility = ViscosityContrast(np.array([contrast]), geometry.membranes, 1e-12)
    mobility.assemble(geometry, None, layer)
    (inverse, shifts), _ = Inextensibility(1e-12, ROUND_OFF).factorize(mobility, geometry)
    eigenvalues = np.linalg.eigvalsh(inverse)
    assert eigenvalues.max() < points * np.median(eigenvalues)
    constant = np.full(points, points**-0.5)
    np.testing.assert_allclose(inverse @ constant * shifts, constant, rtol=0, atol=1e-6)


def test_the_inverse_of_another_geometry_changes_nothing_but_the_work() -> None:
    scene = uneven_pair()
    geometry = geometry_of(scene)
    moved = Geometry(geometry.membranes, placed_state(scene) + 0.3 * smooth_direction(geometry.membranes))
    load = np.stack([moved.points[1], np.zeros_like(moved.points[1])])
    fresh, kept = Inextensibility(1e-12, ROUND_OFF), Inextensibility(1e-12, ROUND_OFF)
    inverse, _ = kept.factorize(layer_of(geometry), geometry)
    found, _ = fresh.solve(layer_of(moved), moved, load)
    again, served = kept.solve(layer_of(moved), moved, load, inverse)
    assert served is inverse
    np.testing.assert_allclose(
        again.tension, found.tension, rtol=0, atol=1e-8 * np.max(np.abs(found.tension))
    )
    np.testing.assert_allclose(again.velocity, found.velocity, rtol=0, atol=1e-10)
    assert kept.iterations > fresh.iterations
