"""Random scenes over wide ranges end with an outcome or with a reason, never otherwise."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from solver.analysis.run import Outcome
from solver.scene import Numerics, PowerLaw, Scene
from solver.simulation.simulate import simulate
from tests.solver.random_scenes import RANGES, objections, random_scenes
from tests.solver.scenes import shear_pair

SAMPLE = dict(random_scenes(12, wall_limit=1.0))


@pytest.mark.parametrize("name", SAMPLE)
def test_a_random_scene_ends_as_every_run_must(name: str) -> None:
    assert objections(simulate(SAMPLE[name])) == []


def test_scenes_are_the_same_every_time_and_reach_the_ends_of_the_ranges() -> None:
    scenes = dict(random_scenes(200, wall_limit=1.0))
    assert {name: scenes[name] for name in SAMPLE} == SAMPLE
    moduli = [scene.vesicles[0].bending_modulus for scene in scenes.values()]
    low, high = RANGES["bending_modulus"]
    assert low <= min(moduli) < 3 * low < high / 3 < max(moduli) <= high
    assert {len(scene.vesicles) for scene in scenes.values()} == {1, 2}
    assert {scene.flow.kind for scene in scenes.values() if scene.flow} == {"shear", "extension", "trap"}


def test_what_no_run_may_do_is_seen() -> None:
    run = simulate(
        next(iter(SAMPLE.values())).model_copy(update={"numerics": Numerics(points=16, work_limit=1)})
    )
    assert objections(run) == []
    broken = dict(run.series) | {"gap": np.array([np.nan])}
    assert objections(replace(run, time=1e-9, series=broken)) == ["gap is not finite"]
    assert len(objections(replace(run, failure=None))) == 1


def test_the_wall_limit_ends_a_run_and_changes_none_that_does_not_reach_it() -> None:
    scene = SAMPLE["001"]
    free = scene.model_copy(update={"numerics": Numerics(points=32), "horizon": scene.horizon / 100})
    limited = free.model_copy(update={"numerics": Numerics(points=32, wall_limit=1e-9)})
    patient = free.model_copy(update={"numerics": Numerics(points=32, wall_limit=1e6)})
    run = simulate(limited)
    assert run.outcome is Outcome.FAILED
    assert run.failure is not None
    assert "the wall limit of 1e-09 s is reached" in run.failure
    np.testing.assert_array_equal(simulate(patient).frames.tangent_angle, simulate(free).frames.tangent_angle)


def test_a_flow_of_rate_zero_is_none() -> None:
    scene = Scene.model_validate(
        {
            "horizon": 400.0,
            "vesicles": [{"center": [-1.3, 0.0]}, {"center": [1.3, 0.0]}],
            "flow": {"kind": "shear", "rate": 0.0},
            "adhesion": {"hamaker": 1.0, "distance": 0.4},
            "numerics": {"points": 32},
        }
    )
    run = simulate(scene)
    assert run.outcome is simulate(scene.model_copy(update={"flow": None})).outcome is Outcome.EQUILIBRIUM


@pytest.mark.parametrize("name", ["interval", "frame_interval"])
def test_more_records_than_can_be_held_are_refused(name: str) -> None:
    document = {"horizon": 100.0, "vesicles": [{}], "output": {name: 1e-9}}
    with pytest.raises(
        ValueError, match=f"output.{name} must be at least 0.0001, a millionth of the horizon"
    ):
        Scene.model_validate(document)


def test_what_no_refinement_resolves_is_not_begun() -> None:
    """Between the adhesion distance and the cutoff the force falls within a thousandth of a spacing."""
    scene = shear_pair(1.5)
    adhesion = PowerLaw(hamaker=1.5, distance=0.4, cutoff=0.4001)
    run = simulate(scene.model_copy(update={"adhesion": adhesion}))
    assert run.outcome is Outcome.FAILED
    assert run.failure is not None
    assert re.match(r"the run was not begun \(64 points do not resolve the scene: spatial error", run.failure)
    assert run.time == 0


def test_tolerances_that_gave_wrong_outcomes_are_refused() -> None:
    with pytest.raises(ValueError, match=r"less than or equal to 0\.01"):
        Numerics(tolerance=0.03)
