"""What is recorded never changes what is computed, to the last bit."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from solver.analysis.run import Run
from solver.flows import Shear, Trap
from solver.scene import Numerics, Output, PowerLaw, Scene, Start, Vesicle
from solver.simulation.simulate import simulate
from tests.solver.scenes import shear_pair, uneven_pair, with_contrasts
from tests.solver.suspensions import suspension

COARSE = {"points": 32, "tolerance": 1e-3}
CUTOFF = PowerLaw(hamaker=1.5, distance=0.4, cutoff=1.2)

SCENES = {
    "one": Scene(vesicles=(Vesicle(reduced_area=0.8),), flow=Shear(rate=1.0), horizon=3.0),
    "pair": shear_pair(1.5, horizon=3.0),
    "uneven": uneven_pair(flow=Shear(rate=0.5), horizon=2.0),
    "contrast": with_contrasts(uneven_pair(flow=Shear(rate=0.5), horizon=1.0), 3.0, 0.5),
    "cutoff": uneven_pair(adhesion=CUTOFF, flow=Shear(rate=0.5), horizon=1.0),
    "eight": suspension(8),
    "eight-cutoff": suspension(8, adhesion=CUTOFF),
}
OUTPUTS = [
    Output(interval=0.1, frame_interval=1.0),
    Output(interval=0.07, frame_interval=0.3),
    Output(interval=2.0, frame_interval=0.05),
]


@cache
def recorded(scene: str, integrator: str, output: Output) -> Run:
    numerics = Numerics.model_validate({**COARSE, "integrator": integrator})
    return simulate(SCENES[scene].model_copy(update={"numerics": numerics, "output": output}))


def computed(run: Run) -> dict[str, Any]:
    """All that does not depend on the times at which a run is recorded."""
    assert run.failure is None
    work = run.work
    counts = (work.steps, work.rejected_steps, work.jacobian_evaluations, work.factorizations)
    return {
        "last state": (run.frames.tangent_angle[-1].tolist(), run.frames.center[-1].tolist()),
        "last tension": run.frames.tension[-1].tolist(),
        "last values": {name: values[-1] for name, values in run.series.items() if name != "state_rate"},
        "times": (run.time, work.smallest_step, run.error.temporal),
        "counts": counts,
        "answers": answers(run),
    }


def answers(run: Run) -> tuple[Any, ...]:
    """What a run comes to."""
    return run.outcome, run.undecided, run.period, run.settled, run.viscosity, run.inclination_angle, run.gap


@pytest.mark.parametrize("integrator", ["bdf", "rosenbrock", "sdc", "imex-euler"])
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("output", OUTPUTS, ids=lambda output: f"{output.interval}-{output.frame_interval}")
def test_a_run_is_the_same_however_often_it_is_recorded(scene: str, integrator: str, output: Output) -> None:
    if integrator == "rosenbrock" and SCENES[scene].many:
        pytest.skip("refused for many vesicles")
    usual, other = (recorded(scene, integrator, each) for each in (Output(), output))
    assert len(other.series["time"]) != len(usual.series["time"])
    assert computed(other) == computed(usual)


DECIDED = {
    "bound": shear_pair(3.5, rate=2.0),
    "separated": shear_pair(0.3, rate=1.0),
    "tumbling": with_contrasts(
        Scene(horizon=50.0, vesicles=(Vesicle(reduced_area=0.8),), flow=Shear(rate=2.0)), 15.0
    ),
    "trapped": uneven_pair(flow=Trap(rate=0.1), start=Start(relaxed=True, tilt=0.3), horizon=300.0),
    "resting": uneven_pair(horizon=300.0),
}


@cache
def recorded_every(scene: str, interval: float) -> Run:
    output = Output(interval=interval, frame_interval=interval)
    numerics = Numerics.model_validate(COARSE)
    return simulate(DECIDED[scene].model_copy(update={"numerics": numerics, "output": output}))


@pytest.mark.parametrize("scene", DECIDED)
@given(interval=st.floats(0.1, 100.0))
@settings(max_examples=6)
def test_a_run_comes_to_the_same_however_often_it_is_recorded(scene: str, interval: float) -> None:
    assert answers(recorded_every(scene, interval)) == answers(recorded_every(scene, 0.5))


def test_these_runs_are_decided() -> None:
    outcomes = {scene: recorded_every(scene, 0.5).outcome for scene in DECIDED}
    assert outcomes == {
        "bound": "bound",
        "separated": "separated",
        "tumbling": "tumbling",
        "trapped": "bound",
        "resting": "equilibrium",
    }
    assert recorded_every("bound", 0.5).settled
    assert recorded_every("tumbling", 0.5).settled


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-5])
def test_averages_are_as_accurate_as_the_run(tolerance: float) -> None:
    """Against the converged run; and against fine samples of the same run, over the turn before its end."""
    scene = shear_pair(3.5, rate=2.0, output=Output(interval=0.01))
    run, converged = (
        simulate(scene.model_copy(update={"numerics": Numerics(points=32, tolerance=each)}))
        for each in (tolerance, 1e-8)
    )
    assert run.viscosity
    assert converged.viscosity
    assert run.period
    assert run.viscosity.total == pytest.approx(converged.viscosity.total, rel=3 * tolerance)
    series = run.series
    sampled = series["viscosity_bending_tension"] + series["viscosity_adhesion"]
    integral = CubicSpline(series["time"], sampled).integrate(run.time - run.period, run.time)
    assert run.viscosity.total == pytest.approx(float(integral) / run.period, rel=tolerance)


@pytest.mark.parametrize("scene", ["pair", "eight"])
def test_a_sample_is_the_same_whatever_else_is_recorded(scene: str) -> None:
    usual, other = (recorded(scene, "sdc", output) for output in (Output(), OUTPUTS[0]))
    times, here, there = np.intersect1d(usual.series["time"], other.series["time"], return_indices=True)
    assert len(times) == len(usual.series["time"])
    for name in usual.series.keys() - {"state_rate"}:  # that is between neighboring samples
        np.testing.assert_array_equal(other.series[name][there], usual.series[name][here], err_msg=name)


def test_a_relaxed_start_is_the_same_however_often_it_is_recorded() -> None:
    scene = uneven_pair(
        flow=Trap(rate=0.02),
        start=Start(relaxed=True, tilt=0.05),
        numerics=Numerics.model_validate(COARSE),
        horizon=1.0,
    )
    runs = [simulate(scene.model_copy(update={"output": output})) for output in (Output(), *OUTPUTS)]
    for run in runs:
        assert computed(run) == computed(runs[0])


def test_the_work_limit_counts_what_steps_ask_for() -> None:
    """A run that is recorded often is given up at the same step."""
    numerics = Numerics.model_validate({**COARSE, "work_limit": 60})
    scene = shear_pair(1.5, numerics=numerics)
    often, seldom = (
        simulate(scene.model_copy(update={"output": Output(interval=interval)})) for interval in (0.05, 5.0)
    )
    for run in (often, seldom):
        assert run.failure
        assert run.failure.startswith("the work limit of 60 evaluations is reached")
    assert (often.time, often.work.steps) == (seldom.time, seldom.work.steps)
    assert often.work.rhs_evaluations > seldom.work.rhs_evaluations
