"""The equation of motion: its Jacobian, its symmetries, and which terms a scene becomes."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.forces import adhesion as adhesion_module
from solver.membrane.geometry import Geometry
from solver.motion import dense as dense_module
from solver.motion import terms as terms_module
from solver.motion.terms import dense_equation
from solver.potentials import viscosity_contrast as contrast_module
from solver.potentials.proximity import Closeness
from solver.potentials.single_layer import SingleLayer
from solver.scene import Extension, Numerics, PowerLaw, Scene, Shear, Trap, Vesicle
from solver.simulation.initial_state import placed_state
from tests.solver.scenes import smooth_direction, uneven_pair

Array = NDArray[np.float64]
TIGHT = Numerics(points=64, tolerance=1e-9)
FLOWS = [None, Shear(rate=0.8), Extension(rate=0.3), Trap(rate=0.3)]


@pytest.mark.parametrize("flow", FLOWS, ids=lambda flow: flow.kind if flow else "rest")
def test_the_jacobian_is_exact(flow: Any) -> None:
    """Against fourth-order differences of the rate, along smooth changes of state."""
    scene = uneven_pair(flow=flow, numerics=Numerics(points=96, tolerance=1e-9))
    dynamics, state, step = dense_equation(scene), placed_state(scene), 1e-3
    membranes = dynamics.membranes
    state += 0.2 * smooth_direction(membranes, seed=5)
    jacobian = dynamics.jacobian(state)
    centers = np.eye(len(state))[-4:]
    for direction in [smooth_direction(membranes, 0), smooth_direction(membranes, 1), *centers]:
        rates = [dynamics.rate(state + k * step * direction) for k in (-2, -1, 1, 2)]
        exact = np.array([1, -8, 8, -1]) @ np.array(rates) / (12 * step)
        claimed = jacobian @ direction
        np.testing.assert_allclose(claimed, exact, rtol=0, atol=1e-7 * np.max(np.abs(exact)))


def transformed(scene: Scene, state: Array, angle: float, shift: Array) -> Array:
    membranes = dense_equation(scene).membranes
    c, s = np.cos(angle), np.sin(angle)
    center = membranes.center(state) @ np.array([[c, s], [-s, c]]) + shift
    return membranes.pack(membranes.tangent_angle(state) + angle, center)


def test_the_rate_of_a_turned_and_shifted_state_is_the_turned_rate() -> None:
    scene = uneven_pair(numerics=TIGHT)
    state = placed_state(scene)
    there = transformed(scene, state, 0.9, np.array([5.0, -3.0]))
    membranes = dense_equation(scene).membranes
    rate, turned = dense_equation(scene).rate(state), dense_equation(scene).rate(there)
    scale = np.max(np.abs(rate))
    np.testing.assert_allclose(
        membranes.tangent_angle(turned), membranes.tangent_angle(rate), rtol=0, atol=1e-10 * scale
    )
    rotation = np.array([[np.cos(0.9), np.sin(0.9)], [-np.sin(0.9), np.cos(0.9)]])
    np.testing.assert_allclose(
        membranes.center(turned), membranes.center(rate) @ rotation, rtol=0, atol=1e-10 * scale
    )


@pytest.mark.parametrize("flow", FLOWS, ids=lambda flow: flow.kind if flow else "rest")
def test_membranes_do_not_stretch_and_fluid_does_not_vanish(flow: Any) -> None:
    scene = uneven_pair(flow=flow, numerics=Numerics(points=128, tolerance=1e-9))
    motion = dense_equation(scene).motion(placed_state(scene))
    geometry = motion.geometry
    gradient = geometry.arclength_derivative(motion.velocity)
    scale = np.max(np.abs(gradient))
    assert np.max(np.abs(np.sum(geometry.tangents * gradient, axis=0))) < 1e-9 * scale
    through = np.mean(np.sum(geometry.normals * motion.velocity, axis=0), axis=1)
    assert np.max(np.abs(through)) < 1e-9 * np.max(np.abs(motion.velocity))


def test_forces_feed_what_the_fluid_dissipates() -> None:
    """At rest −dE/dt, by differences along the motion, is the work of all forces on the fluid."""
    scene = uneven_pair(numerics=Numerics(points=128, tolerance=1e-9))
    dynamics, state, step = dense_equation(scene), placed_state(scene), 1e-4
    assert dynamics.adhesion
    rate = dynamics.rate(state)
    energy = []
    for k in (-2, -1, 1, 2):
        geometry = Geometry(dynamics.membranes, state + k * step * rate)
        energy.append(
            dynamics.bending.energy(geometry) + dynamics.adhesion.energy(geometry, Closeness(geometry))
        )
    change = np.array([1, -8, 8, -1]) @ energy / (12 * step)
    motion = dynamics.motion(state)
    assert motion.adhesion is not None
    force = motion.bending + motion.adhesion
    work = np.sum(force * motion.velocity * dynamics.membranes.spacing[:, None])
    assert -change == pytest.approx(work, rel=1e-6)
    assert work > 0


TERMS = [
    (terms_module, "DirectAdhesion"),
    (dense_module, "Closeness"),
    (adhesion_module, "WithinCutoff"),
    (terms_module, "ViscosityContrast"),
    (contrast_module, "DoubleLayer"),
]


@pytest.fixture
def constructed(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Counts how often each optional term is constructed, by subclasses of the real ones."""
    counts: Counter[str] = Counter()
    for module, name in TERMS:
        original = getattr(module, name)

        def counting(*args: Any, original: Any = original, name: str = name) -> Any:
            counts[name] += 1
            return original(*args)

        monkeypatch.setattr(module, name, counting)
    return counts


VESICLE, OTHER = Vesicle(center=(-1.5, 0.0)), Vesicle(center=(1.5, 0.0))
VISCOUS = Vesicle(center=(-1.5, 0.0), viscosity_contrast=3.0)
ADHESION = PowerLaw(hamaker=1.0, distance=0.4)


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"vesicles": (VESICLE,)}, set()),
        ({"vesicles": (VESICLE,), "adhesion": ADHESION}, set()),
        ({"vesicles": (VESICLE, OTHER)}, {"Closeness"}),
        ({"vesicles": (VESICLE, OTHER), "adhesion": ADHESION}, {"Closeness", "DirectAdhesion"}),
        ({"vesicles": (VESICLE,), "flow": Trap(rate=0.5)}, set()),
        (
            {"vesicles": (VESICLE, OTHER), "adhesion": ADHESION, "flow": Shear(rate=0.5)},
            {"Closeness", "DirectAdhesion"},
        ),
        (
            {"vesicles": (VESICLE, OTHER), "adhesion": ADHESION.model_copy(update={"cutoff": 1.0})},
            {"Closeness", "DirectAdhesion", "WithinCutoff"},
        ),
        ({"vesicles": (VISCOUS,)}, {"ViscosityContrast", "DoubleLayer"}),
        ({"vesicles": (VISCOUS, OTHER)}, {"Closeness", "ViscosityContrast", "DoubleLayer"}),
    ],
)
def test_terms_that_a_scene_lacks_are_never_constructed(
    constructed: Counter[str], fields: dict[str, Any], expected: set[str]
) -> None:
    scene = Scene(horizon=1.0, **fields)
    dynamics = dense_equation(scene)
    state = placed_state(scene)
    dynamics.rate(state)
    dynamics.jacobian(state)
    assert set(constructed) == expected


def test_the_terms_are_constructed_once_a_simulation(constructed: Counter[str]) -> None:
    scene = uneven_pair(flow=Trap(rate=0.1))
    dynamics = dense_equation(scene)
    for _ in range(3):
        dynamics.rate(placed_state(scene))
    assert constructed["DirectAdhesion"] == 1


def test_vesicles_far_apart_are_not_interpolated(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    original = SingleLayer.assemble

    def spied(self: SingleLayer, geometry: Geometry, closeness: Closeness | None) -> None:
        original(self, geometry, closeness)
        assert closeness
        calls.append(closeness.refinement(4.0).interpolations.shape)

    monkeypatch.setattr(SingleLayer, "assemble", spied)
    scene = Scene(horizon=1.0, vesicles=(Vesicle(center=(-4.0, 0.0)), Vesicle(center=(4.0, 0.0))))
    dense_equation(scene).rate(placed_state(scene))
    assert calls == [(0, 64)]


@pytest.mark.parametrize(
    "zero",
    [
        {"adhesion": PowerLaw(hamaker=0.0, distance=0.4)},
        {"flow": Shear(rate=0.0)},
        {"flow": Extension(rate=0.0)},
        {"flow": Trap(rate=0.0)},
    ],
)
def test_a_term_of_zero_strength_changes_round_off_only(zero: dict[str, Any]) -> None:
    without = uneven_pair(adhesion=None, numerics=TIGHT)
    state = placed_state(without)
    expected = dense_equation(without).rate(state)
    rate = dense_equation(without.model_copy(update=zero)).rate(state)
    np.testing.assert_allclose(rate, expected, rtol=0, atol=1e-13 * np.max(np.abs(expected)))
