"""A pair that is its own image under a half turn: half the unknowns, the same motion."""

from __future__ import annotations

import math

import numpy as np
import pytest

from solver.membrane.symmetry import has_images, independent_vesicles
from solver.motion.terms import dense_equation
from solver.scene import Extension, Numerics, PowerLaw, Scene, Shear, Start, Trap, Vesicle
from solver.simulation.initial_state import placed_state
from solver.simulation.simulate import simulate
from tests.solver.scenes import shear_pair, smooth_direction

FLOWS = [Shear(rate=0.5), Extension(rate=0.1), Trap(rate=0.1), None]


def pair(first: dict[str, object], second: dict[str, object], **fields: object) -> Scene:
    vesicles = (Vesicle.model_validate(first), Vesicle.model_validate(second))
    return Scene.model_validate(
        {"horizon": 5.0, "vesicles": vesicles, "adhesion": PowerLaw(hamaker=1.5, distance=0.4)} | fields
    )


def tilted(flow: Shear | Extension | Trap | None, offset: float = 0.0) -> Scene:
    """A pair with images; with an ``offset`` it has none, though nothing else changes."""
    return pair(
        {"reduced_area": 0.8, "center": (-1.1 + offset, 0.2), "angle": 1.4},
        {"reduced_area": 0.8, "center": (1.1 + offset, -0.2), "angle": 1.4 - math.pi},
        flow=flow,
        numerics=Numerics(tolerance=1e-7),
    )


def test_what_has_images() -> None:
    first = {"center": (-1.5, 0.3), "angle": 0.4}
    image = {"center": (1.5, -0.3), "angle": 0.4}
    assert has_images(pair(first, image))
    assert has_images(pair(first, image | {"angle": 0.4 + math.pi}))
    assert len(independent_vesicles(pair(first, image))) == 1


@pytest.mark.parametrize(
    "change",
    [
        {"center": (1.5, 0.3)},
        {"center": (1.5 + 1e-12, -0.3)},
        {"angle": 0.5},
        {"angle": 0.4 + math.pi / 2},
        {"reduced_area": 0.91},
        {"length": 6.0},
        {"bending_modulus": 1.1},
    ],
    ids=str,
)
def test_what_has_none(change: dict[str, object]) -> None:
    scene = pair({"center": (-1.5, 0.3), "angle": 0.4}, {"center": (1.5, -0.3), "angle": 0.4} | change)
    assert not has_images(scene)
    assert independent_vesicles(scene) == scene.vesicles


def test_one_vesicle_and_three_have_none() -> None:
    alone = Scene(horizon=1.0, vesicles=(Vesicle(),))
    three = tuple(Vesicle(center=(4.0 * side, 0.0)) for side in (-1, 0, 1))
    assert not has_images(alone)
    assert not has_images(alone.model_copy(update={"vesicles": three}))


@pytest.mark.parametrize("flow", FLOWS, ids=lambda flow: flow.kind if flow else "rest")
def test_the_rate_is_that_of_the_pair(flow: Shear | Extension | Trap | None) -> None:
    """Round-off and the tolerance of the sums, at most 1e-7 of the velocity, are all that may differ."""
    half, whole = tilted(flow), tilted(flow, offset=1e-12)
    rates = []
    for scene in (half, whole):
        dynamics = dense_equation(scene)
        rate = dynamics.rate(placed_state(scene))
        rates.append((dynamics.membranes.tangent_angle(rate)[0], dynamics.membranes.center(rate)[0]))
    for mine, theirs in zip(*rates, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=2e-7 * np.max(np.abs(theirs)))


@pytest.mark.parametrize("flow", FLOWS, ids=lambda flow: flow.kind if flow else "rest")
def test_a_run_reports_both_vesicles(flow: Shear | Extension | Trap | None) -> None:
    half, whole = simulate(tilted(flow)), simulate(tilted(flow, offset=1e-12))
    np.testing.assert_allclose(half.frames.center, whole.frames.center, rtol=0, atol=1e-6)
    # The image begins at the opposite point of the second vesicle's ellipse, which was placed half turned.
    tangents = (np.exp(1j * run.frames.tangent_angle) for run in (half, whole))
    np.testing.assert_allclose(*tangents, rtol=0, atol=1e-5)
    assert set(half.series) == set(whole.series)
    compared = {"gap", "bending_energy", "adhesion_energy", "center_distance", "center_angle"}
    if isinstance(flow, Shear):
        compared |= {"viscosity_bending_tension", "viscosity_adhesion"}
    for name in compared:
        np.testing.assert_allclose(half.series[name], whole.series[name], rtol=1e-5, atol=1e-5, err_msg=name)
    np.testing.assert_allclose(half.frames.tension, whole.frames.tension, rtol=0, atol=1e-3)


def test_a_relaxed_start_is_turned_with_its_image() -> None:
    scene = tilted(Trap(rate=0.05)).model_copy(
        update={"start": Start(relaxed=True, tilt=0.1), "horizon": 1.0}
    )
    run = simulate(scene)
    first, second = run.frames.center[0]
    np.testing.assert_allclose(first, -second, rtol=0, atol=1e-15)
    assert run.series["center_angle"][0] == pytest.approx(np.pi / 2 + 0.1, abs=1e-12)


@pytest.mark.parametrize("flow", FLOWS, ids=lambda flow: flow.kind if flow else "rest")
def test_the_jacobian_follows_the_image(flow: Shear | Extension | Trap | None) -> None:
    scene = shear_pair(1.5, numerics={"points": 96, "tolerance": 1e-9}).model_copy(update={"flow": flow})
    dynamics, state = dense_equation(scene), placed_state(scene)
    assert state.size == 98
    direction, size = smooth_direction(dynamics.membranes), 1e-4
    difference = (dynamics.rate(state + size * direction) - dynamics.rate(state - size * direction)) / (
        2 * size
    )
    error = dynamics.jacobian(state) @ direction - difference
    assert np.linalg.norm(error) < 1e-6 * np.linalg.norm(difference)
