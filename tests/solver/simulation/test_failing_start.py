"""A run in which not even the first velocity can be computed ends as failed, with its start recorded."""

from __future__ import annotations

import numpy as np
import pytest

from solver.analysis.run import LARGEST_SPATIAL, Outcome, Run
from solver.membrane.geometry import Geometry, Membranes
from solver.potentials.neighbors import gap
from solver.scene import Numerics, PowerLaw, Scene, Shear, Start, Trap, Vesicle
from solver.simulation.initial_state import placed_state
from solver.simulation.simulate import simulate


def slender(**fields: object) -> Vesicle:
    """Far more slender than 64 points resolve."""
    return Vesicle.model_validate({"reduced_area": 0.03} | fields)


def check_start(run: Run) -> None:
    """Only what a velocity or a tension is needed for is unknown."""
    assert run.outcome is Outcome.FAILED
    assert run.failure
    assert "64 points do not resolve the scene" in run.failure
    assert run.time == 0.0
    assert run.work.steps == 0
    assert run.series["time"].tolist() == [0.0]
    assert run.error.spatial > LARGEST_SPATIAL
    assert run.error.area < 1e-12
    assert run.error.temporal == 0.0
    geometry = Geometry(Membranes.of_scene(run.scene), placed_state(run.scene))
    count = len(run.scene.vesicles)
    assert run.frames.tangent_angle.shape == (1, count, 64)
    np.testing.assert_array_equal(run.frames.tangent_angle[0, 0], geometry.tangent_angle[0])
    assert np.isnan(run.frames.tension).all()
    assert run.energy.bending > 0
    assert np.isnan(run.series["state_rate"][0])
    assert run.viscosity is None
    assert run.period is None


@pytest.mark.parametrize("contrast", [1.0, 100.0])
def test_a_single_vesicle(contrast: float) -> None:
    vesicle = slender(viscosity_contrast=contrast)
    run = simulate(Scene(horizon=1.0, vesicles=(vesicle,), flow=Shear(rate=0.5)))
    check_start(run)
    assert run.inclination_angle == pytest.approx(90)
    assert np.isnan(run.series["viscosity_bending_tension"][0])


def pair(**fields: object) -> Scene:
    """With images, or without: unequal bending moduli."""
    vesicles = (slender(center=(-1.5, 0.0)), slender(center=(1.5, 0.0)))
    defaults = {"horizon": 1.0, "vesicles": vesicles, "adhesion": PowerLaw(hamaker=1.0, distance=0.4)}
    return Scene.model_validate(defaults | fields)


@pytest.mark.parametrize("equal", [True, False])
def test_a_pair(equal: bool) -> None:
    scene = pair()
    if not equal:
        scene = pair(vesicles=(scene.vesicles[0], slender(center=(1.5, 0.0), bending_modulus=2.0)))
    run = simulate(scene)
    check_start(run)
    geometry = Geometry(Membranes.of_scene(scene), placed_state(scene))
    assert run.gap == gap(geometry)
    assert run.energy.adhesion is not None
    assert np.isnan(run.energy.adhesion)
    assert run.series["center_distance"].tolist() == [3.0]


def test_a_pair_that_cannot_even_relax() -> None:
    run = simulate(pair(flow=Trap(rate=0.1), start=Start(relaxed=True)))
    check_start(run)


def test_many() -> None:
    vesicles = tuple(slender(center=(3.0 * column, 0.0)) for column in range(8))
    run = simulate(pair(vesicles=vesicles, numerics=Numerics(work_limit=100)))
    check_start(run)
    assert run.vesicle_series["vesicle_center"].shape == (1, 8, 2)
