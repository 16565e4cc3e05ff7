"""Runs in flows whose rate changes with time: exact motions, breaks, orders, and when they are decided."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from solver.analysis.run import Outcome
from solver.flows import Extension, ImposedFlow, Linear, Shear
from solver.integrators import InitialValueProblem, integrator_for
from solver.integrators.control import root_mean_square
from solver.integrators.integrator import FACTORIES
from solver.integrators.one_step import OneStepMethod
from solver.integrators.rodas5p import RODAS5P
from solver.integrators.rosenbrock import Rosenbrock
from solver.integrators.sdc import DeferredCorrection
from solver.motion.terms import dense_equation, equation_of_motion
from solver.motion.timed import TimedEquation, with_clock
from solver.protocols import Ramp, RateProtocol, Sine, Steps
from solver.scene import Numerics, Scene, Vesicle
from solver.simulation.initial_state import placed_state
from solver.simulation.simulate import simulate
from tests.solver.scenes import shear_pair, smooth_direction, uneven_pair
from tests.solver.steps import equal_steps, sheared_pair
from tests.solver.suspensions import suspension

Array = NDArray[np.float64]

RAMP = Ramp(begin=0.5, duration=2.0, start=0.3, end=1.5)
SINE = Sine(mean=0.4, amplitude=1.2, period=1.7, phase=0.3)
STEPS = Steps(times=(0.7, 1.9), factors=(1.0, 0.2, 1.4))
FLOWS = [Shear(rate=0.6), Extension(rate=0.4), Linear(rate=0.5, flow_type=0.4)]
every_protocol = pytest.mark.parametrize("protocol", [RAMP, SINE, STEPS], ids=lambda each: each.kind)


def changing(scene: Scene, protocol: RateProtocol, **fields: object) -> Scene:
    return scene.model_copy(update={"protocol": protocol, **fields})


@every_protocol
@pytest.mark.parametrize(
    "flow",
    [Shear(rate=0.6), Extension(rate=0.4), Linear(rate=0.5, flow_type=0.4)],
    ids=lambda flow: flow.kind,
)
def test_a_circle_is_carried_by_the_integral_of_the_rate(protocol: RateProtocol, flow: ImposedFlow) -> None:
    """Its center moves with the fluid there (Faxen's law in a linear flow), in whatever frame."""
    start = np.array([0.8, 1.1])
    vesicle = Vesicle(reduced_area=1.0, center=tuple(start.tolist()))
    numerics = Numerics(points=32, tolerance=1e-8)
    scene = Scene(horizon=3.0, vesicles=(vesicle,), flow=flow, protocol=protocol, numerics=numerics)
    run = simulate(scene)
    gradient = flow.velocity_gradient(np.zeros(2))
    for time, center in zip(run.frames.time, run.frames.center[:, 0], strict=True):
        exact = expm(gradient * protocol.integral(time)) @ start
        np.testing.assert_allclose(center, exact, rtol=0, atol=1e-6)


@every_protocol
@pytest.mark.parametrize("count", [2, 8])
def test_the_jacobian_knows_the_time(protocol: RateProtocol, count: int) -> None:
    """Along the clock alone; for many vesicles as well, whose Jacobian is not exact otherwise."""
    scene = uneven_pair(flow=Shear(rate=0.5)) if count == 2 else suspension(count)
    scene = changing(scene, protocol, numerics=Numerics(points=32, tolerance=1e-9))
    equation, time, step = equation_of_motion(scene, time=1.0), 1.2, 1e-3
    state = placed_state(scene)
    later, earlier = (equation.rate(with_clock(state, time + shift)) for shift in (step, -step))
    alone = np.append(np.zeros(state.size), 1.0)
    claimed = equation.jacobian(with_clock(state, time)) @ alone
    scale = 1e-3 + np.abs(claimed).max()
    np.testing.assert_allclose(claimed, (later - earlier) / (2 * step), rtol=0, atol=1e-4 * scale)


def test_the_jacobian_solves_what_it_multiplies() -> None:
    scene = changing(uneven_pair(flow=Shear(rate=0.5)), SINE, numerics=Numerics(points=32))
    equation, state = equation_of_motion(scene), with_clock(placed_state(scene), 0.4)
    direction = with_clock(smooth_direction(equation.membranes), 0.7)
    jacobian = equation.jacobian(state)
    right = direction - 0.3 * (jacobian @ direction)
    np.testing.assert_allclose(jacobian.solver(0.3)(right), direction, rtol=0, atol=1e-9)
    columns = np.stack([direction, 2 * direction], axis=1)
    np.testing.assert_allclose((jacobian @ columns)[:, 1], 2 * (jacobian @ direction), rtol=0, atol=1e-12)


@pytest.mark.parametrize("integrator", FACTORIES)
def test_steps_end_at_every_break(integrator: str) -> None:
    scene = uneven_pair(flow=Shear(rate=0.5), horizon=3.0)
    numerics = Numerics(points=32, tolerance=1e-3, integrator=integrator)
    ends: list[float] = []
    simulate(
        changing(scene, STEPS, numerics=numerics), after_step=lambda simulation: ends.append(simulation.time)
    )
    assert set(STEPS.times) <= set(ends)


def test_jumps_are_runs_one_after_the_other() -> None:
    """After a jump a run goes on as one that begins there at the other rate."""
    scene = uneven_pair(flow=Shear(rate=0.5), horizon=1.9, numerics=Numerics(tolerance=1e-7))
    first = simulate(changing(scene, STEPS, horizon=0.7))
    alone = simulate(scene.model_copy(update={"horizon": 0.7}))
    np.testing.assert_allclose(first.frames.center[-1], alone.frames.center[-1], rtol=0, atol=1e-7)
    equation = equation_of_motion(scene.model_copy(update={"flow": Shear(rate=0.5 * 0.2)}))
    state = equation.membranes.pack(alone.frames.tangent_angle[-1], alone.frames.center[-1])
    integrator = integrator_for(InitialValueProblem(equation, state, 0.7, 1.9), scene.numerics, 2)
    step = integrator.step()
    while step.end < 1.9:
        step = integrator.step()
    whole = simulate(changing(scene, STEPS))
    centers = equation.membranes.center(step.state)
    np.testing.assert_allclose(centers, whole.frames.center[-1], rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("method", "least"),
    [
        (DeferredCorrection(1), 0.8),
        (DeferredCorrection(2), 1.8),
        (DeferredCorrection(3), 2.8),
        (Rosenbrock(RODAS5P), 3.0),
    ],
    ids=["1", "2", "3", "rodas5p"],
)
def test_orders_are_those_at_a_constant_rate(method: OneStepMethod, least: float) -> None:
    """In steps as long as in the tests of the methods, during which the rate changes its sign."""
    _, state, _ = sheared_pair(2.0)
    # Its own one, because its flow changes, and tests share that of the pair.
    dynamics = dense_equation(shear_pair(1.5, numerics=Numerics(points=32, tolerance=1e-9)))
    equation = TimedEquation(dynamics, Shear(rate=0.5), SINE, 0.0)

    def final(each: OneStepMethod, count: int) -> Array:
        return equal_steps(each, equation, with_clock(state, 0.0), 1.0, count)[-1].state

    exact = final(DeferredCorrection(6), 64)
    coarse, fine = (root_mean_square(final(method, count) - exact) for count in (16, 32))
    assert 1e-12 < fine < 1e-2
    assert np.log2(coarse / fine) > least


def test_reported_errors_hold() -> None:
    scene = changing(uneven_pair(flow=Shear(rate=0.5), horizon=4.0), SINE)
    accurate = simulate(scene.model_copy(update={"numerics": Numerics(tolerance=1e-8)}))
    run = simulate(scene.model_copy(update={"numerics": Numerics(tolerance=1e-4)}))
    true = np.sqrt(np.mean((run.frames.center[-1] - accurate.frames.center[-1]) ** 2))
    assert run.error.global_ is not None
    assert 1e-8 < true < 3 * run.error.global_ < 1e-2


def test_a_run_is_decided_once_the_rate_is_constant() -> None:
    """A vesicle that treads steadily before the ramp goes on to the inclination of the last rate."""
    vesicle = (Vesicle(reduced_area=0.8),)
    ramp = Ramp(begin=60.0, duration=20.0, start=0.1, end=1.0)
    run = simulate(Scene(horizon=400.0, vesicles=vesicle, flow=Shear(rate=1.0), protocol=ramp))
    constant = simulate(Scene(horizon=400.0, vesicles=vesicle, flow=Shear(rate=1.0)))
    assert run.outcome is constant.outcome is Outcome.STEADY
    assert run.time > 80
    assert constant.time < 60
    assert run.inclination_angle == pytest.approx(constant.inclination_angle, abs=1e-2)
    assert run.viscosity is None
    assert run.series["flow_rate"][0] == pytest.approx(0.1)
    assert run.series["flow_rate"][-1] == 1.0


def test_flow_that_stops_leaves_an_equilibrium() -> None:
    stop = Steps(times=(2.0,), factors=(1.0, 0.0))
    run = simulate(
        Scene(horizon=400.0, vesicles=(Vesicle(reduced_area=0.8),), flow=Shear(rate=1.0), protocol=stop)
    )
    assert run.outcome is Outcome.EQUILIBRIUM


def test_a_pair_in_a_rate_that_never_stops_changing_is_followed_to_the_horizon() -> None:
    run = simulate(changing(shear_pair(1.5, horizon=60.0), Sine(mean=1.0, amplitude=0.3, period=20.0)))
    assert run.outcome is Outcome.COMPLETED
    assert run.time == 60.0
    assert run.period is run.error.period is None


def test_what_the_rate_does_from_the_horizon_on_plays_no_part() -> None:
    """Not its jump to another rate, to none or at the horizon itself, and no ramp that begins there."""
    pair = shear_pair(3.5, horizon=100.0, numerics=Numerics(points=32, tolerance=1e-3))
    plain, *later = (
        simulate(pair),
        *(
            simulate(changing(pair, protocol))
            for protocol in (
                Steps(times=(150.0,), factors=(1.0, 2.0)),
                Steps(times=(100.0, 101.0), factors=(1.0, 0.0, 1000.0)),
                Ramp(begin=100.0, duration=1.0, start=1.0, end=0.0),
            )
        ),
    )
    assert plain.outcome is Outcome.BOUND
    assert plain.time < 100
    for run in later:
        assert run.outcome is plain.outcome
        assert run.time == pytest.approx(plain.time, rel=1e-2)
        assert run.period == pytest.approx(plain.period, rel=1e-2)
        assert run.effective_aspect_ratio == pytest.approx(plain.effective_aspect_ratio, rel=1e-2)
        assert (run.time, run.period, run.gap) == (later[0].time, later[0].period, later[0].gap)


def test_a_ramp_that_the_horizon_cuts_off_is_followed_to_it() -> None:
    ramp = Ramp(begin=10.0, duration=100.0, start=1.0, end=0.0)
    run = simulate(
        changing(shear_pair(3.5, horizon=20.0, numerics=Numerics(points=32, tolerance=1e-3)), ramp)
    )
    assert run.outcome is Outcome.COMPLETED
    assert run.time == 20.0


def test_turns_under_another_rate_do_not_count() -> None:
    """The pair turns four times as fast first; the period is that of the last rate."""
    slow = shear_pair(1.5, rate=0.5, horizon=400.0)
    jump = Steps(times=(40.0,), factors=(4.0, 1.0))
    run, alone = simulate(changing(slow, jump)), simulate(slow)
    assert run.outcome is Outcome.BOUND
    assert run.period == pytest.approx(alone.period, rel=0.01)
    assert run.error.period is not None
