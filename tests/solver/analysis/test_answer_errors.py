"""The errors of answers, against runs at a far smaller tolerance."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from solver.analysis.answer_errors import change_of
from solver.analysis.run import Outcome, Run
from solver.forces.tension import TensionNotFoundError
from solver.scene import Extension, Numerics
from solver.simulation.simulate import simulate
from tests.solver.scenes import shear_pair

FACTOR = 3.0  # that is promised


def run_at(tolerance: float, hamaker: float, **fields: Any) -> Run:
    numerics = Numerics(points=32, tolerance=tolerance)
    return simulate(shear_pair(hamaker, numerics=numerics).model_copy(update=fields))


def test_period_and_viscosity_of_a_pair_that_stays_together() -> None:
    run, truth = (run_at(tolerance, 1.5, horizon=240.0) for tolerance in (1e-4, 1e-8))
    assert run.outcome is Outcome.BOUND
    assert run.period
    assert truth.period
    assert run.error.period
    assert 1e-7 < abs(run.period - truth.period) < FACTOR * run.error.period < 0.1
    assert run.viscosity
    assert truth.viscosity
    assert run.error.viscosity
    assert abs(run.viscosity.total - truth.viscosity.total) < FACTOR * run.error.viscosity < 0.05
    assert run.error.time is None
    assert not run.sensitive


@pytest.mark.parametrize("tolerance", [1e-4, 1e-5, 1e-6])
def test_a_lead_in_time_is_no_error_of_an_average(tolerance: float) -> None:
    """Next to the critical strength, 0.36, a pair hesitates, and leads grow and shrink a hundredfold."""
    run, truth = (run_at(each, 0.4, horizon=500.0) for each in (tolerance, 1e-8))
    assert run.viscosity
    assert truth.viscosity
    assert run.error.viscosity
    error = abs(run.viscosity.total - truth.viscosity.total)
    assert error / FACTOR < run.error.viscosity < 20 * error


def test_time_of_separation() -> None:
    run, truth = (run_at(tolerance, 0.2, horizon=480.0) for tolerance in (1e-5, 1e-8))
    assert run.outcome is truth.outcome is Outcome.SEPARATED
    assert run.error.time
    assert run.error.time / FACTOR < abs(run.time - truth.time) < FACTOR * run.error.time
    assert run.error.period is None
    assert not run.sensitive


def test_a_pair_that_might_come_back_is_sensitive() -> None:
    """At shear rate 0.5 the critical adhesion strength is 0.36, with 64 points as with 32."""
    run = run_at(1e-3, 0.35, horizon=800.0)
    assert run.outcome is Outcome.SEPARATED
    assert run.sensitive
    assert not run_at(1e-5, 0.35, horizon=800.0).sensitive


def test_an_error_larger_than_its_answer_is_unknown() -> None:
    """At this tolerance a pair just beyond the critical adhesion strength never comes to its true motion."""
    run = run_at(1e-3, 0.38, horizon=800.0)
    assert run.sensitive
    assert run.period
    assert run.error.global_ is None
    assert run.error.period is None
    assert run.error.viscosity is None


def test_inclination_of_a_pair_in_strain() -> None:
    fields = {"horizon": 10.0} | {"flow": Extension(rate=0.05)}
    run, truth = (run_at(tolerance, 1.5, **fields) for tolerance in (1e-4, 1e-8))
    assert run.inclination_angle is not None
    assert truth.inclination_angle is not None
    assert run.error.inclination_angle is not None
    assert abs(run.inclination_angle - truth.inclination_angle) <= FACTOR * run.error.inclination_angle + 1e-9


@pytest.mark.parametrize("integrator", ["rosenbrock", "sdc"])
def test_what_does_not_propagate_errors_reports_none(integrator: str) -> None:
    numerics = Numerics(points=32, tolerance=1e-3, integrator=integrator)
    run = simulate(shear_pair(1.5, numerics=numerics, horizon=0.5))
    assert run.error.global_ is None
    assert run.error.viscosity is None


def test_an_error_of_the_state_that_leaves_no_motion_is_infinite() -> None:
    """The second column leads to a state in which the quantity cannot be computed."""

    def quantity(state: np.ndarray) -> float:
        if state[1] < 0:
            raise TensionNotFoundError("no motion")
        return float(3 * state[0])

    change = change_of(quantity, np.zeros(2), np.array([[1e-3, 0.0], [0.0, 1e-3]]))
    assert change[0] == pytest.approx(3e-3)
    assert change[1] == np.inf
