"""Flows between extension, shear and rotation: known ones at its ends, and what a pair does between them."""

from __future__ import annotations

import numpy as np
import pytest

from solver.analysis.run import Outcome, Run
from solver.flows import Extension, Linear, Shear
from solver.scene import PowerLaw, Scene, Start, Vesicle
from solver.simulation.simulate import simulate
from tests.solver.scenes import uneven_pair, with_contrasts

ADHESION = PowerLaw(hamaker=0.7, distance=0.4)


def turned(scene: Scene, angle: float) -> Scene:
    """The scene with all vesicles turned about the origin."""
    cosine, sine = np.cos(angle), np.sin(angle)
    vesicles = []
    for vesicle in scene.vesicles:
        x, y = vesicle.center
        center = (cosine * x - sine * y, sine * x + cosine * y)
        vesicles.append(vesicle.model_copy(update={"center": center, "angle": vesicle.angle + angle}))
    return scene.model_copy(update={"vesicles": tuple(vesicles)})


def relaxed_pair(flow_type: float, offset: float = 0.0) -> Run:
    """A relaxed pair at the rate 0.05."""
    return simulate(
        Scene(
            horizon=2000.0,
            vesicles=(Vesicle(center=(-1.5, offset)), Vesicle(center=(1.5, offset))),
            adhesion=ADHESION,
            flow=Linear(rate=0.05, flow_type=flow_type),
            start=Start(relaxed=True),
        )
    )


@pytest.mark.parametrize("contrasts", [(1.0, 1.0), (3.0, 0.5)])
def test_equal_strain_and_rotation_are_shear_in_turned_axes(contrasts: tuple[float, float]) -> None:
    """Shapes, places, tensions and all parts of the viscosity; the vesicles are in no way symmetric."""
    shear = with_contrasts(uneven_pair(flow=Shear(rate=0.5), horizon=4.0), *contrasts)
    along_x = simulate(shear)
    linear = turned(shear, np.pi / 4).model_copy(update={"flow": Linear(rate=0.5)})
    along_diagonal = simulate(linear)
    assert along_diagonal.work.steps == along_x.work.steps > 5
    for name, values in along_x.series.items():
        shift = np.pi / 4 if name == "center_angle" else 0.0
        if "error" not in name and name != "state_rate":  # the largest component, in whatever axes
            np.testing.assert_allclose(along_diagonal.series[name] - shift, values, rtol=0, atol=1e-9)
    ours, theirs = along_diagonal.frames, along_x.frames
    np.testing.assert_allclose(ours.tangent_angle[-1] - np.pi / 4, theirs.tangent_angle[-1], atol=1e-9)
    np.testing.assert_allclose(ours.tension[-1], theirs.tension[-1], atol=1e-8)


def test_strain_alone_is_extension() -> None:
    """Also beside the stagnation point, where the frame moves with the pair."""
    scene = uneven_pair(flow=Extension(rate=0.3), horizon=4.0)
    extension, linear = (
        simulate(scene.model_copy(update={"flow": flow}))
        for flow in (Extension(rate=0.3), Linear(rate=0.3, flow_type=1.0))
    )
    np.testing.assert_allclose(linear.frames.center[-1], extension.frames.center[-1], rtol=1e-9)
    np.testing.assert_allclose(linear.frames.tangent_angle, extension.frames.tangent_angle, atol=1e-9)


def test_a_vesicle_in_rotation_turns_as_a_rigid_body() -> None:
    vesicle = Vesicle(reduced_area=0.7, center=(1.0, 0.0))
    run = simulate(Scene(horizon=30.0, vesicles=(vesicle,), flow=Linear(rate=0.5, flow_type=-1.0)))
    assert run.outcome is Outcome.TUMBLING
    assert run.period == pytest.approx(4 * np.pi, rel=1e-4)
    assert run.viscosity is None
    radius = np.hypot(*run.frames.center[:, 0].T)
    np.testing.assert_allclose(radius, 1.0, atol=1e-3)


def test_a_pair_rests_where_strain_prevails_far_enough() -> None:
    run = relaxed_pair(0.8)
    assert run.outcome is Outcome.BOUND
    assert run.period is None
    assert run.inclination_angle == pytest.approx(153.48, abs=0.01)  # behind the axis, by the rotation
    assert run.viscosity is not None
    last = [run.series[name][-1] for name in ("viscosity_bending_tension", "viscosity_adhesion")]
    assert run.viscosity.total == pytest.approx(sum(last), rel=1e-12)


def test_a_pair_revolves_where_strain_prevails_a_little() -> None:
    """Lines of two directions do not turn, but the pair is not slender enough to stay there."""
    run = relaxed_pair(0.3)
    assert run.outcome is Outcome.BOUND
    assert run.settled
    assert run.inclination_angle is None
    assert run.error.inclination_angle is None
    assert run.error.period is not None
    assert run.effective_aspect_ratio == pytest.approx(1.309, abs=0.01)


def test_a_pair_carried_away_is_followed_where_strain_prevails() -> None:
    """Relative to their mean vesicles move as about the stagnation point."""
    scene = uneven_pair(flow=Linear(rate=0.3, flow_type=0.4), horizon=8.0)
    shift = np.array([2.0, 1.0])
    moved = scene.model_copy(
        update={
            "vesicles": tuple(
                vesicle.model_copy(update={"center": tuple((np.array(vesicle.center) + shift).tolist())})
                for vesicle in scene.vesicles
            )
        }
    )
    here, there = (simulate(each).frames.center[-1] for each in (scene, moved))
    np.testing.assert_allclose(np.diff(there, axis=0), np.diff(here, axis=0), atol=1e-10)
    gradient = scene.flow.velocity_gradient(np.zeros(2)) if scene.flow else np.zeros((2, 2))
    values, vectors = np.linalg.eig(gradient)
    carried = (vectors * np.exp(8.0 * values)) @ np.linalg.solve(vectors, shift)
    np.testing.assert_allclose((there - here).mean(axis=0), carried, rtol=1e-9)
