"""Runs that start from a state of another run, a deformed shape, or a relaxed pair at any angle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError

from solver.analysis.run import Outcome, Run
from solver.membrane.geometry import Geometry, Membranes
from solver.membrane.symmetry import has_images
from solver.protocols import Ramp
from solver.scene import Numerics, PowerLaw, Scene, Shear, Start, Trap, Vesicle
from solver.scene.start import RandomWaves
from solver.simulation.initial_state import placed_state
from solver.simulation.simulate import simulate
from tests.solver.scenes import shear_pair, uneven_pair


def started_from(run: Run, index: int, **fields: object) -> Scene:
    """The run's scene from one of its recorded states on."""
    frames = run.frames
    vesicles = tuple(
        vesicle.model_copy(
            update={"tangent_angle": tuple(shape.tolist()), "angle": 0.0, "center": tuple(center.tolist())}
        )
        for vesicle, shape, center in zip(
            run.scene.vesicles, frames.tangent_angle[index], frames.center[index], strict=True
        )
    )
    return run.scene.model_copy(update={"vesicles": vesicles, "start": Start(), **fields})


@pytest.mark.parametrize("points", [64, "auto"])
@pytest.mark.parametrize("symmetric", [True, False])
def test_a_run_goes_on_from_a_state_of_its_own(symmetric: bool, points: int | str) -> None:
    numerics = Numerics.model_validate({"points": points, "tolerance": 1e-6})
    pair = shear_pair(0.7) if symmetric else uneven_pair(flow=Shear(rate=0.5))
    whole = simulate(pair.model_copy(update={"horizon": 20.0, "numerics": numerics}))
    half_way = int(np.searchsorted(whole.frames.time, 10.0))
    later = started_from(whole, half_way, horizon=10.0)
    assert whole.frames.time[half_way] == 10.0
    assert has_images(later) == symmetric
    rest = simulate(later)
    np.testing.assert_allclose(rest.frames.center[-1], whole.frames.center[-1], rtol=0, atol=2e-5)
    np.testing.assert_allclose(
        rest.series["bending_energy"][-1], whole.series["bending_energy"][-1], rtol=1e-4
    )


@pytest.mark.parametrize("points", [48, 64, 96])
def test_a_deformation_is_the_same_with_any_number_of_points(points: int) -> None:
    deformation = RandomWaves(amplitude=0.08, seed=5, waves=6)
    scene = Scene(
        horizon=1.0,
        vesicles=(Vesicle(reduced_area=0.8), Vesicle(reduced_area=0.8, center=(4.0, 0.0))),
        start=Start(deformation=deformation),
        numerics=Numerics(points=points),
    )
    membranes = Membranes.of_scene(scene)
    plain = scene.model_copy(update={"start": Start()})
    state, ellipses = placed_state(scene), placed_state(plain)
    change = membranes.tangent_angle(state) - membranes.tangent_angle(ellipses)
    np.testing.assert_allclose(np.sqrt(np.mean(change**2, axis=1)), 0.08, rtol=0.25)
    assert np.abs(change[0] - change[1]).max() > 0.05  # each has its own
    geometry = Geometry(membranes, state)
    np.testing.assert_allclose(geometry.areas / np.pi, 0.8, rtol=1e-13)
    np.testing.assert_allclose(geometry.tangents.mean(axis=2), 0, atol=1e-14)
    finest = placed_state(scene.model_copy(update={"numerics": Numerics(points=192)}))
    fine = finest.reshape(-1)[: 2 * 192].reshape(2, 192)[:, :: 192 // math.gcd(192, points)]
    coarse = membranes.tangent_angle(state)[:, :: points // math.gcd(192, points)]
    np.testing.assert_allclose(coarse, fine, rtol=0, atol=1e-5)


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_waves_that_make_vesicles_overlap_are_refused(seed: int) -> None:
    """They are refused where the shapes in which the run would start overlap, and only there."""
    apart = Scene(
        horizon=1.0,
        vesicles=(Vesicle(center=(-2.0, 0.0)), Vesicle(center=(2.0, 0.0))),
        start=Start(deformation=RandomWaves(amplitude=0.19, seed=seed)),
        numerics=Numerics(points=128),
    )
    membranes = Membranes.of_scene(apart)
    first, second = np.swapaxes(Geometry(membranes, placed_state(apart)).points, 0, 1)
    # They move along x until they touch: how far they are apart at each height.
    low, high = max(first[1].min(), second[1].min()), min(first[1].max(), second[1].max())
    heights = np.linspace(low, high, 400)[1:-1]
    right = [first[0][np.abs(first[1] - height) < 0.05].max() for height in heights]
    left = [second[0][np.abs(second[1] - height) < 0.05].min() for height in heights]
    touching = float(np.min(np.array(left) - right)) / 2
    for distance, overlap in ((2.0 - touching + 0.02, False), (2.0 - touching - 0.02, True)):
        vesicles = [{"center": (-distance, 0.0)}, {"center": (distance, 0.0)}]
        document = {"horizon": 1.0, "vesicles": vesicles, "start": apart.start.model_dump()}
        if overlap:
            with pytest.raises(ValidationError, match=r"start\.deformation: vesicles 0 and 1 overlap"):
                Scene.model_validate(document)
        else:
            Scene.model_validate(document)


def test_waves_that_make_a_vesicle_cross_itself_are_refused() -> None:
    document = {"horizon": 1.0, "vesicles": [{"reduced_area": 0.3}]}
    with pytest.raises(ValidationError, match=r"start\.deformation: vesicle 0 crosses itself"):
        Scene.model_validate(document | {"start": {"deformation": {"amplitude": 0.5, "seed": 8}}})
    Scene.model_validate(document | {"start": {"deformation": {"amplitude": 0.02}}})


def test_seeds_make_deformations() -> None:
    def state(seed: int) -> np.ndarray:
        start = Start(deformation=RandomWaves(amplitude=0.05, seed=seed))
        numerics = Numerics(points=32)
        return placed_state(Scene(horizon=1.0, vesicles=(Vesicle(),), start=start, numerics=numerics))

    assert np.array_equal(state(1), state(1))
    assert np.abs(state(1) - state(2)).max() > 0.01


def test_a_deformed_pair_is_no_image_of_itself_and_settles_as_the_symmetric_one() -> None:
    scene = shear_pair(1.5)
    deformed = scene.model_copy(update={"start": Start(deformation=RandomWaves(amplitude=0.02))})
    assert has_images(scene)
    assert not has_images(deformed)
    run, symmetric = simulate(deformed), simulate(scene)
    assert run.outcome is symmetric.outcome is Outcome.BOUND
    assert run.period == pytest.approx(symmetric.period, rel=0.01)


TRAPPED = Scene(
    horizon=2.0,
    vesicles=(
        Vesicle(reduced_area=0.8, center=(-1.1, 0.0)),
        Vesicle(reduced_area=0.8, center=(1.1, 0.0)),
    ),
    adhesion=PowerLaw(hamaker=0.7, distance=0.4),
    flow=Trap(rate=0.05),
)


@pytest.mark.parametrize("tilt", [0.4, math.pi / 2, 2.5])
def test_a_relaxed_pair_starts_at_any_angle(tilt: float) -> None:
    run = simulate(TRAPPED.model_copy(update={"start": Start(relaxed=True, tilt=tilt)}))
    expected = math.pi / 2 + tilt
    assert math.remainder(run.series["center_angle"][0] - expected, 2 * math.pi) == pytest.approx(0, abs=1e-9)


def lost_at(run: Run, longer: bool) -> float:
    """The rate at which the centers come farther apart, or closer, than half way."""
    distance = run.series["center_distance"]
    middle = (distance.min() + distance.max()) / 2
    return float(run.series["flow_rate"][np.argmax((distance > middle) == longer)])


def test_slow_ramps_from_the_state_before_show_hysteresis() -> None:
    """Up and down again, against the ends of both states by continuation (README, section 15)."""
    up = Ramp(start=0.9, end=1.0, duration=3000.0)
    risen = simulate(
        TRAPPED.model_copy(
            update={
                "horizon": 6000.0,
                "flow": Trap(rate=0.1),
                "protocol": up,
                "start": Start(relaxed=True),
            }
        )
    )
    assert risen.outcome is Outcome.END_TO_END
    assert 0.09402 < lost_at(risen, longer=True) < 0.0955
    down = Ramp(start=1.0, end=0.8, duration=3000.0)
    again = started_from(risen, -1, horizon=20000.0, flow=Trap(rate=0.05), protocol=down)
    tilted = tuple(
        vesicle.model_copy(update={"angle": 1e-3, "center": (-1e-3 * vesicle.center[1], vesicle.center[1])})
        for vesicle in again.vesicles
    )
    fallen = simulate(again.model_copy(update={"vesicles": tilted}))
    assert fallen.outcome is Outcome.BOUND
    assert 0.040 <= lost_at(fallen, longer=False) < 0.04479
