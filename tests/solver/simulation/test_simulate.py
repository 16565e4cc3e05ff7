"""Whole runs: what is conserved, what never rises, symmetries, errors, and what is recorded."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from solver import Outcome, Run, Scene
from solver.membrane.curve import area, positions, tangents
from solver.scene import Extension, Numerics, Output, PowerLaw, Shear, Start, Trap, Vesicle
from solver.simulation.simulate import Simulation, simulate
from tests.solver.scenes import shear_pair, uneven_pair

Array = NDArray[np.float64]


def energy(run: Run) -> Array:
    return run.series["bending_energy"] + run.series.get("adhesion_energy", 0.0)


def frame_points(run: Run) -> Array:
    """Positions in all frames, (frames, vesicles, 2, points)."""
    lengths = np.array([vesicle.length for vesicle in run.scene.vesicles])
    return positions(run.frames.tangent_angle, run.frames.center, lengths)


def perimeter(points: Array) -> Array:
    """Lengths of closed curves (..., points) by Fourier differentiation of their points."""
    count = points.shape[-1]
    k = np.fft.fftfreq(count, 1 / count)
    k[count // 2] = 0
    derivative = np.fft.ifft(1j * k * np.fft.fft(points, axis=-1), axis=-1).real
    return 2 * np.pi * np.mean(np.hypot(derivative[..., 0, :], derivative[..., 1, :]), axis=-1)


def test_lengths_are_constant() -> None:
    fields = {"horizon": 20.0}
    run = simulate(uneven_pair(flow=Shear(rate=0.5), numerics=Numerics(points=96, tolerance=1e-6), **fields))
    lengths = perimeter(frame_points(run))
    assert len(lengths) == 21
    for k, vesicle in enumerate(run.scene.vesicles):
        np.testing.assert_allclose(lengths[:, k], vesicle.length, rtol=1e-10)


def test_the_area_error_falls_at_the_order_of_the_integrator() -> None:
    """With orders up to 5 the error of a solution falls like tolerance^(5/6)."""
    tolerances = np.array([1e-3, 1e-4, 1e-5, 1e-6, 1e-7])
    runs = [
        simulate(shear_pair(1.5, numerics=Numerics(points=96, tolerance=t), horizon=10.0)) for t in tolerances
    ]
    errors = np.array([run.error.area for run in runs])
    assert np.polyfit(np.log(tolerances), np.log(errors), 1)[0] > 0.8
    assert np.all(errors < 5 * tolerances)
    for run in runs:
        ends = run.frames.tangent_angle[-1]
        true = np.abs(area(frame_points(run)[-1], tangents(ends), 2 * np.pi) / (0.9 * np.pi) - 1).max()
        assert true == pytest.approx(run.series["area_error"][-1], rel=1e-6, abs=1e-14)


@pytest.mark.parametrize(
    "scene",
    [
        uneven_pair(horizon=20.0, numerics=Numerics(tolerance=1e-8)),
        uneven_pair(horizon=10.0, hamaker=0.5, exponents=(12, 6), numerics=Numerics(tolerance=1e-8)),
        Scene(horizon=10.0, vesicles=(Vesicle(reduced_area=0.7),), numerics=Numerics(tolerance=1e-8)),
    ],
    ids=["(4, 2)", "(12, 6)", "one"],
)
def test_energy_never_rises_at_rest(scene: Scene) -> None:
    """Apart from the error of the integration, once nothing moves any more."""
    run = simulate(scene)
    total = energy(run)
    assert total[-1] < total[0] - 0.1
    assert np.max(np.diff(total)) < 5 * scene.numerics.tolerance


def moved(scene: Scene, angle: float, shift: complex) -> Scene:
    """The scene turned about the origin, then shifted."""
    vesicles = []
    for vesicle in scene.vesicles:
        center = complex(*vesicle.center) * np.exp(1j * angle) + shift
        vesicles.append(
            vesicle.model_copy(update={"center": (center.real, center.imag), "angle": vesicle.angle + angle})
        )
    return scene.model_copy(update={"vesicles": tuple(vesicles)})


@pytest.mark.parametrize(
    ("flow", "angle", "shift"),
    [
        (None, 0.9, 5 - 3j),
        (Shear(rate=0.5), 0.0, 4.0),
        (Shear(rate=0.5), np.pi, 0.0),
        (Extension(rate=0.05), np.pi, 0.0),
        (Trap(rate=0.05), np.pi, 5 - 3j),
    ],
    ids=["rest", "shear along x", "shear half turn", "extension half turn", "trap anywhere"],
)
def test_a_moved_scene_runs_to_the_moved_state(flow: Any, angle: float, shift: complex) -> None:
    """Round-off can tip a decision on the step size, so the runs agree to the tolerance and no better."""
    scene = uneven_pair(flow=flow, numerics=Numerics(tolerance=1e-8), horizon=5.0)
    here, there = simulate(scene), simulate(moved(scene, angle, shift))
    points, expected = frame_points(there)[-1], frame_points(here)[-1]
    turned = (expected[:, 0] + 1j * expected[:, 1]) * np.exp(1j * angle) + shift
    np.testing.assert_allclose(points[:, 0] + 1j * points[:, 1], turned, rtol=0, atol=1e-7)
    assert np.max(np.abs(frame_points(here)[-1] - frame_points(here)[0])) > 0.1
    np.testing.assert_allclose(there.frames.tension[-1], here.frames.tension[-1], rtol=1e-5)


def test_shear_seen_from_higher_up_only_carries_along() -> None:
    """A shift across the streamlines adds the constant velocity rate·shift."""
    scene = uneven_pair(flow=Shear(rate=0.5), numerics=Numerics(tolerance=1e-7), horizon=4.0)
    here, there = simulate(scene), simulate(moved(scene, 0.0, 0.3j))
    drift = np.array([0.5 * 0.3 * 4.0, 0.3])
    expected = frame_points(here)[-1] + drift[:, None]
    np.testing.assert_allclose(frame_points(there)[-1], expected, rtol=0, atol=1e-5)


@pytest.mark.parametrize(
    "zero", [{"adhesion": PowerLaw(hamaker=0.0, distance=0.4)}, {"flow": Shear(rate=0.0)}]
)
def test_a_term_of_zero_strength_changes_round_off_only(zero: dict[str, Any]) -> None:
    without = uneven_pair(adhesion=None, numerics=Numerics(tolerance=1e-6), horizon=3.0)
    expected = frame_points(simulate(without))[-1]
    points = frame_points(simulate(without.model_copy(update=zero)))[-1]
    np.testing.assert_allclose(points, expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("integrator", ["bdf", "rosenbrock"])
def test_a_circle_in_shear_stays_a_circle(integrator: str, tolerance: float) -> None:
    """It turns like a rigid disk: intrinsic viscosity 2 (Einstein's result in two dimensions).

    A tension can hold it against the flow only through what is left of an ellipse, and that is what the
    elasticity of a constant tension leaves.
    """
    circle = Vesicle(reduced_area=1.0, length=5.0)
    numerics = Numerics.model_validate({"integrator": integrator, "tolerance": tolerance})
    run = simulate(Scene(horizon=20.0, vesicles=(circle,), flow=Shear(rate=0.5), numerics=numerics))
    assert run.outcome is Outcome.STEADY
    assert run.work.steps < 200
    radius = np.hypot(*np.moveaxis(frame_points(run)[:, 0], 1, 0))
    np.testing.assert_allclose(radius, 5 / (2 * np.pi), rtol=2e-4)
    assert run.viscosity
    assert run.viscosity.total == pytest.approx(2.0, rel=1e-5)


def test_a_circle_at_rest_does_not_move() -> None:
    run = simulate(Scene(horizon=10.0, vesicles=(Vesicle(reduced_area=1.0, center=(1.0, 2.0)),)))
    assert run.outcome is Outcome.EQUILIBRIUM
    np.testing.assert_allclose(frame_points(run)[-1], frame_points(run)[0], rtol=0, atol=1e-9)
    assert run.energy.bending == pytest.approx(np.pi, rel=1e-12)


@pytest.mark.parametrize("excess", [0.0, 1e-8, 1e-6, 1e-4])
def test_a_nearly_round_vesicle_beside_another_stays_round(excess: float) -> None:
    """Its tension grows as its excess length vanishes; what is left of it bends no more than that allows."""
    vesicles = (
        Vesicle(reduced_area=1 - excess, center=(-1.3, 0.0)),
        Vesicle(reduced_area=0.8, center=(1.0, 0.0)),
    )
    run = simulate(
        Scene(
            horizon=20.0,
            vesicles=vesicles,
            adhesion=PowerLaw(hamaker=1.0, distance=0.4),
            numerics=Numerics(work_limit=5000),
        )
    )
    assert run.outcome in {Outcome.EQUILIBRIUM, Outcome.UNDECIDED}
    points = frame_points(run)[:, 0] - run.frames.center[:, 0, :, None]
    np.testing.assert_allclose(np.hypot(points[:, 0], points[:, 1]), 1.0, rtol=2e-2)
    assert energy(run)[-1] < energy(run)[0] - 0.1


def test_three_vesicles_in_shear() -> None:
    vesicles = (Vesicle(center=(-2.4, 0.0)), Vesicle(center=(0.0, 0.1)), Vesicle(center=(2.4, -0.1)))
    run = simulate(
        Scene(
            horizon=5.0, vesicles=vesicles, adhesion=PowerLaw(hamaker=1.0, distance=0.4), flow=Shear(rate=0.5)
        )
    )
    assert run.outcome is Outcome.COMPLETED
    assert run.frames.tangent_angle.shape == (6, 3, 64)
    assert run.error.area < 1e-3
    assert "center_distance" not in run.series


def test_what_is_recorded_and_when() -> None:
    scene = shear_pair(1.5, horizon=3.1, output=Output(interval=0.25, frame_interval=1.0))
    run = simulate(scene)
    assert run.time == 3.1
    np.testing.assert_allclose(run.series["time"], [*np.arange(0, 3.1, 0.25), 3.1], atol=1e-12)
    np.testing.assert_allclose(run.frames.time, [0, 1, 2, 3, 3.1], atol=1e-12)
    assert set(run.series) >= {
        "time",
        "bending_energy",
        "adhesion_energy",
        "area_error",
        "closure_error",
        "gap",
        "center_distance",
        "center_angle",
        "viscosity_bending_tension",
        "viscosity_adhesion",
    }
    assert {len(values) for values in run.series.values()} == {len(run.series["time"])}
    assert run.frames.center.shape == (5, 2, 2)
    assert run.frames.tension.shape == (5, 2, 64)
    distance = np.hypot(*(run.frames.center[:, 1] - run.frames.center[:, 0]).T)
    np.testing.assert_allclose(
        distance, np.interp(run.frames.time, run.series["time"], run.series["center_distance"])
    )
    assert run.gap == run.series["gap"][-1]
    assert run.energy.bending == run.series["bending_energy"][-1]
    assert run.period is None
    assert run.viscosity is None


@pytest.mark.parametrize(
    ("fields", "absent"),
    [
        ({}, {"gap", "center_distance", "center_angle", "adhesion_energy", "viscosity_bending_tension"}),
        ({"adhesion": PowerLaw(hamaker=1.0, distance=0.4)}, {"gap", "adhesion_energy"}),
        ({"flow": Extension(rate=0.01)}, {"viscosity_bending_tension", "gap"}),
        ({"flow": Shear(rate=0.1)}, {"viscosity_adhesion", "gap"}),
    ],
)
def test_quantities_that_a_scene_lacks_are_absent(fields: dict[str, Any], absent: set[str]) -> None:
    run = simulate(Scene(horizon=0.5, vesicles=(Vesicle(),), **fields))
    assert not absent & set(run.series)
    assert run.gap is None
    assert run.period is None
    assert run.energy.adhesion is None
    assert "inclination_angle" in run.series


def test_interpolated_samples_do_not_depend_on_the_interval() -> None:
    scene = shear_pair(1.5, horizon=4.0)
    fine = simulate(scene.model_copy(update={"output": Output(interval=0.1)}))
    coarse = simulate(scene.model_copy(update={"output": Output(interval=0.5)}))
    for name in ("gap", "center_angle", "bending_energy"):
        np.testing.assert_allclose(coarse.series[name], fine.series[name][::5], rtol=1e-7, err_msg=name)


def test_a_relaxed_start_lies_along_the_diverging_axis() -> None:
    run = simulate(uneven_pair(flow=Trap(rate=0.0), start=Start(relaxed=True, tilt=0.05), horizon=30.0))
    first, second = run.frames.center[0]
    np.testing.assert_allclose((first + second) / 2, 0, atol=1e-12)
    angle = np.arctan2(*(second - first)[::-1])
    assert angle == pytest.approx(np.pi / 2 + 0.05, abs=1e-12)
    at_rest = simulate(uneven_pair(horizon=30.0, output=Output(interval=2.0)))  # as the relaxation is sampled
    assert at_rest.outcome is Outcome.EQUILIBRIUM
    assert energy(run)[0] == pytest.approx(energy(at_rest)[-1], rel=1e-5)
    # The steps are those after the start; the evaluations include the relaxation.
    assert run.work.rhs_evaluations > 10 * run.work.steps


def test_the_work_limit_is_a_failure_with_its_reason() -> None:
    run = simulate(shear_pair(1.5, numerics=Numerics(work_limit=50)))
    assert run.outcome is Outcome.FAILED
    assert run.failure
    assert "work limit of 50" in run.failure
    assert 50 < run.work.rhs_evaluations < 100
    assert 0 < run.time < 20
    assert run.frames.time[0] == 0


def test_a_run_that_does_not_fail_has_no_reason() -> None:
    assert simulate(Scene(horizon=0.5, vesicles=(Vesicle(),))).failure is None


def test_the_caller_can_stop_a_run() -> None:
    times: list[float] = []

    def follow(simulation: Simulation) -> None:
        times.append(simulation.time)
        if len(times) == 5:
            raise StopIteration

    with pytest.raises(StopIteration):
        simulate(shear_pair(1.5), after_step=follow)
    assert len(times) == 5
    assert all(earlier < later for earlier, later in pairwise(times))


def test_the_caller_is_asked_while_the_start_relaxes() -> None:
    def stop(simulation: Simulation) -> None:
        assert simulation.relaxes
        raise StopIteration

    with pytest.raises(StopIteration):
        simulate(uneven_pair(flow=Trap(rate=0.02), start=Start(relaxed=True), horizon=100.0), after_step=stop)


def test_equal_scenes_give_equal_runs() -> None:
    first, second = (simulate(shear_pair(1.5, horizon=5.0)) for _ in range(2))
    np.testing.assert_array_equal(first.frames.tangent_angle, second.frames.tangent_angle)
    np.testing.assert_array_equal(first.series["gap"], second.series["gap"])


def test_the_work_is_counted() -> None:
    run = simulate(shear_pair(1.5, horizon=5.0))
    assert run.work.steps > 10
    assert run.work.rhs_evaluations > run.work.steps
    assert run.work.factorizations >= run.work.jacobian_evaluations >= 1
    assert 0 <= run.work.rejected_steps < run.work.steps
    assert run.work.wall_seconds > 0


def test_a_pair_of_circles_goes_through_its_shear() -> None:
    """Their tension is nearly undetermined: it divides the error of the sums by nearly nothing."""
    vesicles = tuple(Vesicle(reduced_area=1.0, center=(side * 1.5, side * 0.1)) for side in (-1, 1))
    run = simulate(shear_pair(1.5, horizon=20.0).model_copy(update={"vesicles": vesicles}))
    assert run.failure is None
    assert run.time == 20.0
    assert run.error.area < 1e-4
