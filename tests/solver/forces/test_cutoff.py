"""Attraction that ends: a smooth switch, force and Hessian of one energy, sums as accurate as asked for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.analysis.run import Outcome
from solver.forces.adhesion import DirectAdhesion
from solver.membrane.geometry import Geometry
from solver.potentials.proximity import Closeness
from solver.scene import Numerics, PowerLaw, Scene
from solver.simulation.initial_state import placed_state
from solver.simulation.simulate import simulate
from tests.solver.scenes import geometry_of, shear_pair, smooth_direction, uneven_pair

Array = NDArray[np.float64]

DISTANCE, CUTOFF = 0.4, 1.1


def parameters(cutoff: float | None = CUTOFF, exponents: tuple[int, int] = (4, 2)) -> PowerLaw:
    return PowerLaw(hamaker=1.5, distance=DISTANCE, exponents=exponents, cutoff=cutoff)


def scene(points: int = 96, cutoff: float | None = CUTOFF, **fields: Any) -> Scene:
    return uneven_pair(adhesion=parameters(cutoff, **fields), numerics=Numerics(points=points))


def adhesion_of(scene: Scene, accuracy: float = 1e-9) -> DirectAdhesion:
    assert scene.adhesion
    return DirectAdhesion(scene.adhesion, accuracy, geometry_of(scene).membranes)


def whole(r: float, exponents: tuple[int, int]) -> float:
    m, n = exponents
    return float((DISTANCE / r) ** m - m / n * (DISTANCE / r) ** n)


@pytest.mark.parametrize("exponents", [(4, 2), (12, 6), (5, 3)])
def test_the_potential_is_whole_below_the_distance_and_none_beyond_the_cutoff(
    exponents: tuple[int, int],
) -> None:
    def value(r: float) -> float:
        return parameters(exponents=exponents).evaluate(r * r)[0]

    for r in (0.2, 0.39, DISTANCE):
        assert value(r) == pytest.approx(whole(r, exponents), rel=1e-14)
    for r in (CUTOFF, 1.2, 50.0):
        assert value(r) == 0
    between = [value(r) for r in np.linspace(DISTANCE, CUTOFF, 200)]
    assert np.all(np.diff(between) > 0)  # it attracts all the way
    assert all(
        v >= whole(r, exponents) for r, v in zip(np.linspace(DISTANCE, CUTOFF, 200), between, strict=True)
    )


@pytest.mark.parametrize("exponents", [(4, 2), (12, 6), (5, 3)])
@pytest.mark.parametrize("r", [0.3, 0.45, 0.8, 1.05])
def test_its_derivatives_are_exact(exponents: tuple[int, int], r: float) -> None:
    potential, square, step = parameters(exponents=exponents), r * r, 1e-3 * r * r
    weights = np.array([1, -8, 8, -1]) / (12 * step)
    around = np.array([potential.evaluate(square + k * step) for k in (-2, -1, 1, 2)])
    _, slope, bend = potential.evaluate(square)
    scale = abs(bend) + abs(slope)
    np.testing.assert_allclose(weights @ around[:, :2], [slope, bend], rtol=0, atol=1e-6 * scale + 1e-9)


@pytest.mark.parametrize("end", [DISTANCE, CUTOFF])
def test_four_derivatives_are_continuous_at_the_ends_of_the_switch(end: float) -> None:
    """Of χ itself, the ratio to the whole potential: left of an end and right of it a constant."""

    def switch(r: float) -> float:
        return parameters().evaluate(r * r)[0] / whole(r, (4, 2))

    inside = 1 if end == DISTANCE else -1
    steps = np.array([0.02, 0.01])
    departures = [abs(switch(end + inside * step) - switch(end)) for step in steps]
    assert departures[0] / departures[1] == pytest.approx(2**5, rel=0.15)


@pytest.mark.parametrize("exponents", [(4, 2), (12, 6), (5, 3)])
def test_the_force_is_minus_the_gradient_of_the_energy(exponents: tuple[int, int]) -> None:
    setting = scene(exponents=exponents)
    geometry = geometry_of(setting)
    membranes, state, step = geometry.membranes, placed_state(setting), 1e-3
    adhesion, direction = adhesion_of(setting), smooth_direction(membranes)
    around = [Geometry(membranes, state + k * step * direction) for k in (-2, -1, 1, 2)]
    weights = np.array([1, -8, 8, -1]) / (12 * step)
    energy_change = weights @ [adhesion.energy(g, Closeness(g)) for g in around]
    displacement = np.tensordot(weights, [g.points for g in around], axes=1)
    force = adhesion.density(geometry, Closeness(geometry))
    work = np.sum(force * displacement * membranes.spacing[:, None])
    assert work == pytest.approx(-energy_change, rel=1e-6)
    assert abs(work) > 0.05


@pytest.mark.parametrize("setting", [scene(32), scene(96), shear_pair(1.0)], ids=["refined", "two", "image"])
def test_the_jacobian_is_exact(setting: Scene) -> None:
    setting = setting.model_copy(update={"adhesion": parameters(cutoff=2.5)})
    geometry, state, step = geometry_of(setting), placed_state(setting), 1e-3
    membranes, adhesion = geometry.membranes, adhesion_of(setting, 1e-6)
    jacobian = adhesion.jacobian(geometry, Closeness(geometry))
    for direction in (smooth_direction(membranes), np.eye(len(state))[-1]):
        around = [Geometry(membranes, state + k * step * direction) for k in (-2, -1, 1, 2)]
        forces = [adhesion.density(g, Closeness(g)).reshape(2, -1) for g in around]
        exact = np.tensordot(np.array([1, -8, 8, -1]) / (12 * step), forces, axes=1)
        np.testing.assert_allclose(jacobian @ direction, exact, rtol=0, atol=1e-6 * np.max(np.abs(exact)))


def test_a_far_cutoff_leaves_the_untruncated_adhesion() -> None:
    geometry = geometry_of(scene())
    expected = DirectAdhesion(parameters(None), 1e-9, geometry.membranes).density(
        geometry, Closeness(geometry)
    )
    errors = []
    for cutoff in (10.0, 40.0, 160.0):
        force = adhesion_of(scene(cutoff=cutoff)).density(geometry, Closeness(geometry))
        errors.append(np.max(np.abs(force - expected)) / np.max(np.abs(expected)))
    assert errors[1] < 0.1 * errors[0]
    assert errors[2] < 1e-9


@pytest.mark.parametrize("accuracy", [1e-5, 1e-7, 1e-9])
def test_the_sums_are_as_accurate_as_asked_for(accuracy: float) -> None:
    """Against the same curves refined as far as it goes."""
    geometry = geometry_of(scene(64))
    computed, expected = (
        adhesion_of(scene(64), asked).density(geometry, Closeness(geometry)) for asked in (accuracy, 1e-13)
    )
    error = np.max(np.abs(computed - expected))
    assert 0 < error < 3 * accuracy * np.max(np.abs(expected))


def test_beyond_the_cutoff_nothing_is_felt_and_within_it_doublets_form() -> None:
    apart, together = (
        simulate(
            shear_pair(3.0, horizon=100.0, output={"interval": 1.0}).model_copy(
                update={"flow": None, "adhesion": parameters(cutoff)}
            )
        )
        for cutoff in (1.0, 2.5)  # the gap is 1.45 to begin with
    )
    assert apart.outcome is Outcome.EQUILIBRIUM
    assert apart.energy.adhesion == 0
    assert together.gap is not None
    assert together.gap < 0.5
    assert together.energy.adhesion is not None
    assert together.energy.adhesion < -0.5
