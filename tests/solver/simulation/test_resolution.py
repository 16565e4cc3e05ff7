"""The number of points: what picks it, what raises it, and that a raise changes nothing but the points."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from solver import Outcome, Run, Scene
from solver.analysis.run import LARGEST_SPATIAL, Frames
from solver.membrane.curve import positions
from solver.membrane.geometry import Membranes
from solver.motion import terms
from solver.motion.dense import DenseEquation
from solver.motion.terms import dense_equation
from solver.parallel import Parallel
from solver.scene import Criteria, Numerics, Output, PowerLaw, Shear, Start, Trap, Vesicle
from solver.simulation import simulate as simulate_module
from solver.simulation.initial_state import placed_state
from solver.simulation.resolution import (
    LADDER,
    AdaptiveResolution,
    FixedResolution,
    UnresolvedError,
    resolution_of,
    with_points,
)
from solver.simulation.simulate import simulate
from tests.solver.scenes import shear_pair, uneven_pair

Array = NDArray[np.float64]


def adaptive(scene: Scene, tolerance: float = 1e-4) -> Scene:
    return scene.model_copy(update={"numerics": Numerics(points="auto", tolerance=tolerance)})


def fixed(scene: Scene, points: int, tolerance: float = 1e-4) -> Scene:
    return scene.model_copy(update={"numerics": Numerics(points=points, tolerance=tolerance)})


def single(reduced_area: float, **fields: Any) -> Scene:
    return Scene(horizon=1.0, vesicles=(Vesicle(reduced_area=reduced_area, **fields),))


def touching(distance: float, adhesion: PowerLaw | None) -> Scene:
    """Two unit circles this far apart."""
    center = 1 + distance / 2
    vesicles = (Vesicle(reduced_area=1.0, center=(x, 0.0)) for x in (-center, center))
    return Scene(horizon=1.0, vesicles=tuple(vesicles), adhesion=adhesion)


def first_points(scene: Scene, tolerance: float = 1e-4) -> int:
    return resolution_of(adaptive(scene, tolerance)).points


def strongly_adhering(hamaker: float, horizon: float) -> Scene:
    """Two vesicles at rest that adhesion draws flat against each other."""
    vesicles = (Vesicle(center=(-1.3, 0.1)), Vesicle(center=(1.3, -0.1)))
    return Scene(
        horizon=horizon,
        vesicles=vesicles,
        adhesion=PowerLaw(hamaker=hamaker, distance=0.4),
        criteria=Criteria(steady_time=2 * horizon),
        output=Output(interval=0.1, frame_interval=0.5),
    )


def difference(run: Run, other: Run, names: tuple[str, ...]) -> float:
    """Largest relative difference between the two runs' diagnostics at any time."""
    np.testing.assert_allclose(run.series["time"], other.series["time"], rtol=0, atol=1e-12)
    return max(
        float(np.max(np.abs(run.series[name] - other.series[name])) / np.max(np.abs(other.series[name])))
        for name in names
    )


class Scripted:
    """Asks for more points at stated times."""

    def __init__(self, points: int, raises: Mapping[float, int]) -> None:
        self.points = points
        self._raises = dict(raises)
        self.judged: list[tuple[float, int]] = []

    def finer(self, membranes: Membranes, time: float, state: Array) -> int | None:
        assert state.size == membranes.state_size
        self.judged.append((time, membranes.points))
        due = next((at for at in self._raises if time > at), None)
        return None if due is None else self._raises.pop(due)


def scripted(monkeypatch: pytest.MonkeyPatch, points: int, raises: Mapping[float, int]) -> Scripted:
    script = Scripted(points, raises)
    monkeypatch.setattr(simulate_module, "resolution_of", lambda scene: script)
    return script


# The first number of points.


def test_slender_vesicles_get_more_points() -> None:
    points = [first_points(single(reduced_area)) for reduced_area in (1.0, 0.9, 0.7, 0.5, 0.4, 0.3)]
    assert points[0] == LADDER[0]
    assert points == sorted(points)
    assert points[-1] >= 4 * points[1]


def test_tighter_tolerances_get_more_points() -> None:
    points = [first_points(single(0.6), tolerance) for tolerance in (1e-2, 1e-4, 1e-6, 1e-8, 1e-11)]
    assert all(earlier < later for earlier, later in pairwise(points))


def test_the_most_slender_vesicle_decides() -> None:
    vesicles = (Vesicle(reduced_area=0.95, center=(-2.0, 0.0)), Vesicle(reduced_area=0.4, center=(2.0, 0.0)))
    assert first_points(Scene(horizon=1.0, vesicles=vesicles)) == first_points(single(0.4))


def test_where_adhesion_acts_close_vesicles_get_more_points() -> None:
    strong = PowerLaw(hamaker=1.0, distance=0.4)
    points = [first_points(touching(distance, strong)) for distance in (0.4, 0.01, 0.003)]
    assert points[0] == LADDER[0]
    assert points[0] < points[1] < points[2]
    assert first_points(touching(0.003, None)) == LADDER[0]


def test_a_short_adhesion_distance_gets_more_points_from_afar() -> None:
    points = [first_points(touching(1.0, PowerLaw(hamaker=1.0, distance=d))) for d in (0.4, 0.01, 0.003)]
    assert points[0] == LADDER[0]
    assert points[0] < points[1] < points[2]


def test_the_ladder_has_an_end() -> None:
    assert first_points(single(0.1)) == LADDER[-1]


# Judging a state.


def rough(scene: Scene, points: int, amplitude: float) -> tuple[Membranes, Array]:
    """The start with a wave of this amplitude in the last third of the tangent angle's spectrum."""
    given = with_points(scene, points)
    membranes, state = Membranes.of_scene(given), placed_state(given)
    alpha = 2 * np.pi * np.arange(points) / points
    wave = np.tile(amplitude * np.cos((points // 2 - 2) * alpha), membranes.count)
    state[: wave.size] += wave
    return membranes, state


def test_what_persists_weighs_more_than_what_the_start_has() -> None:
    resolution = AdaptiveResolution(adaptive(single(1.0)))
    membranes, state = rough(single(1.0), 64, 1e-3)
    assert resolution.finer(membranes, 0.0, state) is None
    assert resolution.finer(membranes, 1e-5, state) is None
    assert resolution.finer(membranes, 10.0, state) == 96


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6])
def test_a_tighter_tolerance_allows_less_of_a_tail(tolerance: float) -> None:
    allowed = 0.04 * tolerance ** (2 / 3)  # from `spatial_error`: 100·tail^1.5 ≤ tolerance
    resolution = AdaptiveResolution(adaptive(single(1.0), tolerance))
    assert resolution.finer(*_at(10.0, rough(single(1.0), 64, allowed))) is None
    assert resolution.finer(*_at(10.0, rough(single(1.0), 64, 1.5 * allowed))) == 96


def _at(time: float, start: tuple[Membranes, Array]) -> tuple[Membranes, float, Array]:
    return start[0], time, start[1]


def test_what_changes_fast_is_soon_judged_as_lasting() -> None:
    """A tenth of a time unit is little to a soft vesicle at rest, much in a fast flow or to a stiff one."""
    verdicts = []
    for fields in ({}, {"flow": Shear(rate=100.0)}):
        for modulus in (0.01, 100.0):
            scene = single(1.0, bending_modulus=modulus).model_copy(update=fields)
            start = rough(scene, 64, 1e-3)
            verdicts.append(AdaptiveResolution(adaptive(scene)).finer(*_at(0.1, start)))
    assert verdicts == [None, 96, 96, 96]


def test_past_the_ladder_a_rough_state_is_accepted_and_a_gap_too_small_refused() -> None:
    adhesion = PowerLaw(hamaker=1.0, distance=0.4)
    near, far = touching(1e-4, adhesion), touching(0.1, adhesion)
    top = LADDER[-1]
    resolution = AdaptiveResolution(adaptive(far))
    assert resolution.finer(*_at(10.0, rough(far, top, 0.1))) is None
    with pytest.raises(UnresolvedError, match=f"time 10 than {top} points"):
        resolution.finer(*_at(10.0, rough(near, top, 0.0)))
    assert resolution.finer(*_at(10.0, rough(near, 64, 0.0))) == 96


def test_a_fixed_number_is_never_raised() -> None:
    resolution = resolution_of(fixed(single(0.3), 32))
    assert isinstance(resolution, FixedResolution)
    assert resolution.points == 32
    assert resolution.finer(*_at(10.0, rough(single(0.3), 32, 0.5))) is None


def test_membranes_need_a_number_of_points() -> None:
    with pytest.raises(ValueError, match="'auto'"):
        dense_equation(adaptive(single(0.9)))


# Whole runs.


def test_a_run_that_is_raised_twice_is_the_fine_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """With 48 points this scene is resolved to about the tolerance: raises alone could make a difference."""
    scene = uneven_pair(flow=Shear(rate=0.5), horizon=6.0)
    scene = scene.model_copy(update={"output": Output(interval=0.25, frame_interval=0.5)})
    tolerance = 1e-6
    expected = simulate(fixed(scene, 96, tolerance))
    script = scripted(monkeypatch, 48, {2.1: 64, 4.2: 96})
    run = simulate(fixed(scene, 48, tolerance))
    assert run.work.points == 96
    for before, after in pairwise(script.judged):
        if after[1] > before[1]:  # the refused step is taken again from its start
            assert after[0] < before[0]
    assert sorted({points for _, points in script.judged}) == [48, 64, 96]
    names = ("bending_energy", "adhesion_energy", "center_distance", "center_angle")
    assert difference(run, expected, names) < 20 * tolerance
    # The largest change of any tangent angle, seen at the points alone.
    np.testing.assert_allclose(run.series["state_rate"][1:], expected.series["state_rate"][1:], rtol=0.02)
    assert run.error.area < 20 * tolerance


def test_frames_of_all_parts_have_the_last_number_of_points(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = uneven_pair(flow=Shear(rate=0.5), horizon=3.0)
    expected = simulate(fixed(scene, 96, 1e-6)).frames
    scripted(monkeypatch, 48, {0.9: 64, 1.9: 96})
    frames = simulate(fixed(scene, 48, 1e-6)).frames
    np.testing.assert_allclose(frames.time, [0, 1, 2, 3], atol=1e-12)
    assert frames.tangent_angle.shape == frames.tension.shape == (4, 2, 96)
    np.testing.assert_allclose(frames.center, expected.center, rtol=0, atol=2e-5)
    # Points move along by a sum over them, which differs a little: second moments compare the curves.
    np.testing.assert_allclose(_moments(scene, frames), _moments(scene, expected), rtol=0, atol=1e-4)
    np.testing.assert_allclose(frames.tension.mean(axis=2), expected.tension.mean(axis=2), rtol=1e-3)


def _moments(scene: Scene, frames: Frames) -> Array:
    lengths = np.array([vesicle.length for vesicle in scene.vesicles])
    return np.mean(positions(frames.tangent_angle, frames.center, lengths) ** 2, axis=-1)


def test_the_work_of_all_parts_adds_up(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[DenseEquation] = []
    original = terms.dense_equation

    def of(scene: Scene, parallel: Parallel) -> DenseEquation:
        made.append(original(scene, parallel))
        return made[-1]

    monkeypatch.setattr(terms, "dense_equation", of)
    script = scripted(monkeypatch, 32, {0.5: 48, 1.0: 64})
    run = simulate(fixed(shear_pair(1.5, horizon=2.0), 32))
    assert [equation.membranes.points for equation in made] == [32, 48, 64]
    assert run.work.rhs_evaluations == sum(equation.evaluations + equation.recordings for equation in made)
    assert run.work.jacobian_evaluations >= 3
    assert run.work.factorizations > 3
    assert run.work.steps == len(script.judged) - 2
    assert run.work.rejected_steps >= 2


def test_the_work_limit_holds_for_all_parts_together(monkeypatch: pytest.MonkeyPatch) -> None:
    scripted(monkeypatch, 32, {0.01: 48, 0.1: 64})
    scene = shear_pair(1.5, numerics=Numerics(points=32, work_limit=80))
    run = simulate(scene)
    assert run.outcome is Outcome.FAILED
    assert run.failure
    assert "work limit of 80" in run.failure
    assert run.work.points == 64
    assert 80 < run.work.rhs_evaluations < 110


def test_what_no_number_resolves_fails_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    class Refusing(Scripted):
        def finer(self, membranes: Membranes, time: float, state: Array) -> int | None:
            if time > 0.5:
                raise UnresolvedError("too close")
            return None

    monkeypatch.setattr(simulate_module, "resolution_of", lambda scene: Refusing(32, {}))
    run = simulate(fixed(strongly_adhering(100.0, 2.0), 32))
    assert run.outcome is Outcome.FAILED
    assert run.error.spatial > LARGEST_SPATIAL
    reason = f"32 points do not resolve the scene: spatial error {run.error.spatial:.1e}"
    assert run.failure == f"too close ({reason})"
    assert 0 < run.time <= 0.5


@pytest.mark.parametrize("integrator", ["bdf", "sdc"])
def test_an_automatic_run_raises_its_points_and_meets_the_tolerance(integrator: str) -> None:
    scene, tolerance = strongly_adhering(100.0, 2.0), 1e-4
    expected = simulate(fixed(scene, 192, 1e-7))
    chosen = Numerics.model_validate({"points": "auto", "tolerance": tolerance, "integrator": integrator})
    run = simulate(scene.model_copy(update={"numerics": chosen}))
    assert run.work.points
    assert first_points(scene, tolerance) < run.work.points <= 128
    names = ("bending_energy", "adhesion_energy", "center_distance")
    assert difference(run, expected, names) < 10 * tolerance


def test_what_64_points_do_not_resolve_comes_out_right() -> None:
    """At this adhesion even the error in time is large in the angle of the pair, which nothing holds."""
    scene, names = strongly_adhering(1000.0, 2.0), ("bending_energy", "center_distance", "center_angle")
    expected = simulate(fixed(scene, 256, 1e-7))
    too_coarse, fine, run = simulate(fixed(scene, 64)), simulate(fixed(scene, 256)), simulate(adaptive(scene))
    assert too_coarse.error.spatial > 1e-3
    assert difference(too_coarse, expected, names) > 0.1
    assert difference(run, expected, names) < 2 * difference(fine, expected, names) < 0.1
    assert run.work.points
    assert run.work.points > 64
    assert run.frames.tangent_angle.shape[1:] == (2, run.work.points)


def test_an_automatic_doublet_turns_as_long_as_a_fine_one() -> None:
    """Orbit, period and outcome go on through the raises."""
    run, expected = simulate(adaptive(shear_pair(1.5))), simulate(fixed(shear_pair(1.5), 128, 1e-6))
    assert run.outcome is expected.outcome is Outcome.BOUND
    assert run.work.points
    assert first_points(shear_pair(1.5)) < run.work.points
    assert run.period == pytest.approx(expected.period, rel=1e-3)
    assert run.viscosity
    assert expected.viscosity
    assert run.viscosity.total == pytest.approx(expected.viscosity.total, rel=1e-3)


def test_a_pair_with_images_is_raised_like_one_without() -> None:
    """Shifted by next to nothing the second vesicle is no image any more."""
    scene = adaptive(strongly_adhering(30.0, 1.0), 1e-5)
    vesicles = [v.model_copy(update={"center": (v.center[0] + 1e-12, v.center[1])}) for v in scene.vesicles]
    half, whole = simulate(scene), simulate(scene.model_copy(update={"vesicles": tuple(vesicles)}))
    assert half.work.points == whole.work.points
    assert half.work.points != first_points(scene, 1e-5)
    np.testing.assert_allclose(half.frames.center, whole.frames.center, rtol=0, atol=1e-4)
    np.testing.assert_allclose(half.frames.center[:, 0], -half.frames.center[:, 1], rtol=0, atol=1e-14)
    angle = half.frames.tangent_angle
    np.testing.assert_allclose(angle[:, 1], angle[:, 0] + math.pi, rtol=0, atol=1e-12)


def test_a_relaxed_start_goes_on_with_the_points_of_the_relaxation() -> None:
    scene = strongly_adhering(30.0, 40.0).model_copy(update={"criteria": Criteria()})
    at_rest = simulate(adaptive(scene))
    assert at_rest.outcome is Outcome.EQUILIBRIUM
    trapped = scene.model_copy(
        update={"flow": Trap(rate=0.01), "start": Start(relaxed=True, tilt=0.1), "horizon": 1.0}
    )
    run = simulate(adaptive(trapped))
    assert run.outcome is not Outcome.FAILED
    assert run.work.points
    assert at_rest.work.points
    assert run.work.points >= at_rest.work.points > first_points(trapped)
    assert run.series["bending_energy"][0] == pytest.approx(at_rest.energy.bending, rel=1e-6)
