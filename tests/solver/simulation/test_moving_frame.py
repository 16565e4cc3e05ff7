"""What an extensional flow carries away: its shapes and arrangement as in a trap, its place exactly."""

from __future__ import annotations

import numpy as np
import pytest

from solver.analysis.run import Outcome
from solver.flows import Extension, Trap
from solver.integrators import InitialValueProblem
from solver.integrators.bdf import BackwardDifferentiation
from solver.motion.terms import dense_equation
from solver.scene import Criteria, Numerics, PowerLaw, Scene, Vesicle
from solver.simulation.initial_state import placed_state
from solver.simulation.simulate import simulate
from tests.solver.scenes import uneven_pair

AT_ONCE = Criteria(steady_time=1e6)


def shifted(scene: Scene, offset: tuple[float, float]) -> Scene:
    vesicles = tuple(
        v.model_copy(update={"center": (v.center[0] + offset[0], v.center[1] + offset[1])})
        for v in scene.vesicles
    )
    return scene.model_copy(update={"vesicles": vesicles})


def test_a_pair_leaves_the_stagnation_point_exponentially_and_is_the_pair_of_the_trap_otherwise() -> None:
    rate, horizon = 0.3, 20.0
    pair = Scene(
        horizon=horizon,
        vesicles=(Vesicle(center=(-1.3, 0.0)), Vesicle(center=(1.3, 0.0))),
        adhesion=PowerLaw(hamaker=0.7, distance=0.4),
        flow=Trap(rate=rate),
        numerics=Numerics(points=48),
        criteria=AT_ONCE,
    )
    trapped = simulate(pair)
    offset = (0.25, 0.5)  # in which the places of the vesicles are exact
    carried = simulate(shifted(pair.model_copy(update={"flow": Extension(rate=rate)}), offset))
    assert carried.time == horizon
    assert carried.work.steps == trapped.work.steps
    np.testing.assert_array_equal(carried.series["gap"], trapped.series["gap"])
    time = carried.frames.time[:, None]
    expected = np.array(offset) * np.exp(rate * time * [-1.0, 1.0])
    np.testing.assert_allclose(carried.frames.center.mean(axis=1), expected, rtol=1e-12, atol=1e-12)
    relative = trapped.frames.center + expected[:, None]
    np.testing.assert_allclose(carried.frames.center, relative, rtol=1e-12, atol=1e-12)


def test_an_uneven_pair_moves_as_it_does_in_a_frame_at_rest() -> None:
    """Its mean has a velocity in the frame, too.  Compared with the same flow in the fixed frame."""
    numerics = Numerics(points=48, tolerance=1e-8, integrator="bdf")
    scene = uneven_pair(flow=Extension(rate=0.3), horizon=6.0, numerics=numerics, criteria=AT_ONCE)
    scene = shifted(scene, (1.0, 0.1))
    run = simulate(scene)
    equation = dense_equation(scene)
    problem = InitialValueProblem(equation, placed_state(scene), 0.0, 6.0)
    integrator, time = BackwardDifferentiation(problem, 1e-8), 0.0
    while time < 6.0:
        step = integrator.step()
        time = step.end
    expected = equation.membranes.center(step.state)
    assert np.linalg.norm(expected - run.frames.center[0]) > 1.0
    np.testing.assert_allclose(run.frames.center[-1], expected, rtol=0, atol=2e-6)


def test_vesicles_of_a_suspension_are_placed_in_the_fluid() -> None:
    vesicles = tuple(Vesicle(center=(3.0 * k, 1.0), length=4.0 + k) for k in range(3))
    scene = Scene(horizon=1.0, vesicles=vesicles, flow=Extension(rate=0.5), numerics=Numerics(points=32))
    run = simulate(scene)
    np.testing.assert_allclose(run.vesicle_series["vesicle_center"][0], [v.center for v in vesicles])
    np.testing.assert_array_equal(run.vesicle_series["vesicle_center"][-1], run.frames.center[-1])


def test_a_pair_far_away_is_decided_like_one_at_the_stagnation_point() -> None:
    """In the fixed frame this one failed at time 327, 1e13 lengths away."""
    pair = Scene(
        horizon=2000.0,
        vesicles=(Vesicle(center=(-1.3, 1e-4)), Vesicle(center=(1.3, 1e-4))),
        adhesion=PowerLaw(hamaker=0.7, distance=0.4),
        flow=Extension(rate=0.12),
        numerics=Numerics(points=32),
    )
    run = simulate(pair)
    at_rest = simulate(shifted(pair, (0.0, -1e-4)))
    assert run.outcome is at_rest.outcome is not Outcome.FAILED
    assert run.gap == pytest.approx(at_rest.gap, rel=1e-9)
    assert run.frames.center[-1, :, 1].mean() == pytest.approx(1e-4 * np.exp(0.12 * run.time), rel=1e-9)


def test_a_vesicle_beyond_all_numbers_is_a_failure_with_that_reason() -> None:
    scene = Scene(
        horizon=1e4,
        vesicles=(Vesicle(center=(0.0, 1.0)),),
        flow=Extension(rate=1.0),
        numerics=Numerics(points=32, tolerance=1e-3),
        criteria=Criteria(steady_time=1e6),
        output={"interval": 100.0, "frame_interval": 100.0},
    )
    run = simulate(scene)
    assert run.outcome is Outcome.FAILED
    assert run.failure is not None
    assert "beyond all numbers" in run.failure
    assert run.time > 100.0
    assert np.all(np.isfinite(run.frames.center))
