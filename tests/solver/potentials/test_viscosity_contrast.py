"""Viscosities inside vesicles: known flows, rigid bodies as a limit, reciprocity, and what runs become."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.analysis.run import Outcome
from solver.motion.terms import dense_equation
from solver.scene import Extension, Flow, Numerics, Scene, Shear, Trap, Vesicle
from solver.simulation.initial_state import placed_state
from solver.simulation.simulate import simulate
from tests.solver.references import Ellipse
from tests.solver.scenes import closing, shear_pair, smooth_direction, uneven_pair, with_contrasts

Array = NDArray[np.float64]


def vesicle(contrast: float, points: int = 64, flow: Flow | None = None, **fields: float) -> Scene:
    return Scene(
        horizon=100.0,
        vesicles=(Vesicle(viscosity_contrast=contrast, **fields),),
        flow=flow,
        numerics=Numerics(points=points),
    )


@pytest.mark.parametrize("contrast", [1e-3, 0.3, 3.0, 1e4])
def test_the_flow_of_a_strained_drop(contrast: float) -> None:
    """The force 2(1 + λ)Ex on a unit circle moves it with Ex, a uniform strain inside."""
    dynamics = dense_equation(scene := vesicle(contrast, points=32, reduced_area=1.0))
    geometry = dynamics.motion(placed_state(scene)).geometry
    assert dynamics.contrast
    strain = np.stack([geometry.points[0], -geometry.points[1]])
    force = 2 * (1 + contrast) * strain * geometry.membranes.spacing[:, None]
    moved = dynamics.contrast.matrix @ force.ravel()
    np.testing.assert_allclose(moved, strain.ravel(), rtol=0, atol=1e-11 * max(1, 1 / contrast))


def reciprocity_error(points: int) -> float:
    """How much the work of one set of forces in the flow of another depends on which is which."""
    scene = with_contrasts(uneven_pair(numerics=Numerics(points=points, tolerance=1e-9)), 6.0, 0.2)
    dynamics = dense_equation(scene)
    geometry = dynamics.motion(placed_state(scene)).geometry
    assert dynamics.contrast
    alpha = 2 * np.pi * np.arange(points) / points + np.zeros((2, 1))
    weights = geometry.membranes.spacing[:, None]
    forces = [
        (weights * np.stack([np.exp(np.sin(alpha)), np.cos(2 * alpha)])).ravel(),
        (weights * np.stack([np.sin(3 * alpha), np.exp(np.cos(alpha - 1))])).ravel(),
    ]
    mutual = forces[0] @ dynamics.contrast.matrix @ forces[1]
    return float(abs(mutual - forces[1] @ dynamics.contrast.matrix @ forces[0]) / abs(mutual))


def test_the_mobility_is_reciprocal_with_spectral_accuracy() -> None:
    errors = [reciprocity_error(points) for points in (32, 64, 128)]
    assert errors[0] < 1e-2
    assert errors[1] < 0.05 * errors[0]
    assert errors[2] < 1e-9


@pytest.mark.parametrize("angle", [0.0, 0.6, 1.4])
def test_a_very_viscous_vesicle_turns_as_a_rigid_ellipse(angle: float) -> None:
    """Jeffery (Proc. R. Soc. A 102, 161, 1922), in two dimensions."""
    scene = vesicle(1e7, flow=Shear(rate=0.7), reduced_area=0.8, angle=angle)
    motion = dense_equation(scene).motion(placed_state(scene))
    ellipse = Ellipse.of(0.8, 2 * np.pi)
    a2, b2 = ellipse.major**2, ellipse.minor**2
    rate = -0.7 * (a2 * np.sin(angle) ** 2 + b2 * np.cos(angle) ** 2) / (a2 + b2)
    np.testing.assert_allclose(motion.rotation_rate, rate, rtol=0, atol=1e-5)


def test_a_very_viscous_vesicle_tumbles_with_jefferys_period() -> None:
    """Inner viscosity keeps its shape an ellipse for the time of a turn."""
    run = simulate(vesicle(3e4, flow=Shear(rate=1.0), reduced_area=0.85))
    ellipse = Ellipse.of(0.85, 2 * np.pi)
    aspect = ellipse.major / ellipse.minor
    assert run.outcome is Outcome.TUMBLING
    assert run.period == pytest.approx(2 * np.pi * (aspect + 1 / aspect), rel=1e-3)
    assert run.effective_aspect_ratio == pytest.approx(aspect, rel=2e-3)
    assert run.error.area < 1e-6


@pytest.mark.parametrize("contrast", [0.01, 0.5, 7.0, 1e3])
def test_a_circular_vesicle_is_as_viscous_as_a_rigid_disk(contrast: float) -> None:
    """Inextensible, it can but turn: [μ] = 2 (Einstein, in two dimensions) and half the shear rate."""
    run = simulate(vesicle(contrast, flow=Shear(rate=0.5), reduced_area=1.0, angle=0.0))
    assert run.outcome is Outcome.STEADY
    assert run.viscosity is not None
    assert run.viscosity.total == pytest.approx(2, abs=1e-4)
    # That its shape is round to 1e-6 is magnified.
    assert run.viscosity.contrast == pytest.approx(0, abs=1e-4 + 2e-6 * contrast)


def test_the_stress_is_that_of_the_far_flow() -> None:
    """Far away the disturbance is that of a stresslet: x (x·M·x)/(2πr⁴), M_xy the mean shear stress."""
    scene = vesicle(5.0, points=96, flow=Shear(rate=1.0), reduced_area=0.7, angle=0.9)
    motion = (dynamics := dense_equation(scene)).motion(placed_state(scene))
    geometry = motion.geometry
    force = motion.bending + geometry.arclength_derivative(motion.tension * geometry.tangents)
    assert dynamics.contrast
    spacing = geometry.membranes.spacing
    stress = dynamics.contrast.stress(geometry, motion.velocity, np.array([[0.0, 1.0], [0.0, 0.0]]))
    stress -= float(np.sum(force[0] * geometry.points[1] * spacing[:, None]))
    points, force, velocity = (each.reshape(2, -1) for each in (geometry.points, force, motion.velocity))
    outward = -geometry.normals.reshape(2, -1)

    def disturbance(x: Array) -> Array:
        r = x[:, None] - points
        r2 = np.sum(r**2, axis=0)
        single = (-0.5 * np.log(r2) * force + r * np.sum(r * force, axis=0) / r2) / (4 * np.pi)
        across, along = np.sum(r * outward, axis=0), np.sum(r * velocity, axis=0)
        double = r * across * along / r2**2 / np.pi
        return np.asarray((single + (1 - 5.0) * double).sum(axis=1) * spacing[0])

    radius, angles = 1e3, np.linspace(0, 2 * np.pi, 8, endpoint=False)
    away = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    radial = np.array([disturbance(radius * unit) @ unit for unit in away])
    of_shear = 2 * np.mean(radial * np.sin(2 * angles)) * 2 * np.pi * radius
    assert of_shear == pytest.approx(-stress, rel=1e-4)


@pytest.mark.parametrize("flow", [None, Shear(rate=0.8), Extension(rate=0.3), Trap(rate=0.3)])
@pytest.mark.parametrize("contrasts", [(5.0, 0.2), (1.0, 40.0)])
def test_the_jacobian_is_exact(flow: Flow | None, contrasts: tuple[float, float]) -> None:
    """Against fourth-order differences of the rate, along smooth changes that keep the curves closed."""
    scene = with_contrasts(uneven_pair(flow=flow, numerics=Numerics(points=128, tolerance=1e-9)), *contrasts)
    dynamics, state, step = dense_equation(scene), placed_state(scene), 1e-3
    jacobian = dynamics.jacobian(state)
    for direction in (smooth_direction(dynamics.membranes, 0), np.eye(len(state))[-3]):
        direction = closing(dynamics.membranes, state, direction)
        rates = [dynamics.rate(state + k * step * direction) for k in (-2, -1, 1, 2)]
        exact = np.array([1, -8, 8, -1]) @ np.array(rates) / (12 * step)
        np.testing.assert_allclose(jacobian @ direction, exact, rtol=0, atol=1e-6 * np.max(np.abs(exact)))


def test_a_contrast_of_next_to_one_is_next_to_none() -> None:
    scene = uneven_pair(flow=Shear(rate=0.5), numerics=Numerics(tolerance=1e-9))
    state = placed_state(scene)
    expected = dense_equation(scene).rate(state)
    rate = dense_equation(with_contrasts(scene, 1 + 1e-12, 1.0)).rate(state)
    np.testing.assert_allclose(rate, expected, rtol=0, atol=1e-9 * np.max(np.abs(expected)))


def test_close_vesicles_of_unequal_viscosities_are_resolved() -> None:
    """At a gap of a third of a spacing the motion is that with twice as many points."""
    rates = []
    for points in (128, 256):
        numerics = Numerics(points=points, tolerance=1e-6)
        scene = with_contrasts(uneven_pair(flow=Shear(rate=0.5), numerics=numerics), 20.0, 0.1)
        first, second = scene.vesicles
        near = second.model_copy(update={"center": (0.38, -0.2)})
        scene = scene.model_copy(update={"vesicles": (first, near), "adhesion": None})
        dynamics = dense_equation(scene)
        motion = dynamics.motion(placed_state(scene))
        assert motion.closeness is not None
        rates.append((motion.closeness.nearest, motion.velocity[:, :, :: points // 128]))
    (gap, coarse), (_, fine) = rates
    assert gap < 0.4
    np.testing.assert_allclose(coarse, fine, rtol=0, atol=1e-4 * np.max(np.abs(fine)))


def test_a_pair_with_contrasts_runs_as_its_half() -> None:
    """A vesicle and its image, against both computed."""
    half = with_contrasts(shear_pair(1.5, horizon=6.0), 5.0, 5.0)
    first, second = half.vesicles
    whole = half.model_copy(
        update={"vesicles": (first, second.model_copy(update={"center": (1.5 + 1e-12, 0.0)}))}
    )
    runs = simulate(half), simulate(whole)
    np.testing.assert_allclose(runs[0].frames.center, runs[1].frames.center, rtol=0, atol=1e-5)
    for name in ("viscosity_contrast", "viscosity_adhesion", "gap"):
        np.testing.assert_allclose(runs[0].series[name], runs[1].series[name], rtol=0, atol=1e-4)


def keller_skalak(reduced_area: float) -> float:
    """Contrast at which an ellipse ceases to tread (J. Fluid Mech. 120, 27, 1982), in two dimensions.

    The inclination obeys φ' = rate·(−½ + ½ f₀ [f₁ + 1/(f₁ (1 + f₂ (λ − 1)))] cos 2φ).
    """
    ellipse = Ellipse.of(reduced_area, 2 * np.pi)
    a, b = ellipse.major, ellipse.minor
    f0, f1, f2 = 2 * a * b / (a**2 + b**2), (a / b - b / a) / 2, (a**2 + b**2) / (a + b) ** 2
    return float(1 + (1 / (f1 * (1 / f0 - f1)) - 1) / f2)


@pytest.mark.parametrize("reduced_area", [0.95, 0.75])
def test_treading_gives_way_to_tumbling_where_theory_puts_it(reduced_area: float) -> None:
    critical = keller_skalak(reduced_area)
    below, above = (
        simulate(vesicle(factor * critical, flow=Shear(rate=1.0), reduced_area=reduced_area))
        for factor in (0.85, 1.25)
    )
    assert below.outcome is Outcome.STEADY
    assert below.period is None
    assert above.outcome is Outcome.TUMBLING
    assert above.viscosity is not None
    assert above.viscosity.contrast is not None
