"""Which integrator a scene gets, and that whole runs agree whichever it is."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from solver.analysis.run import Outcome
from solver.integrators import InitialValueProblem, integrator_for
from solver.integrators.bdf import BackwardDifferentiation
from solver.integrators.control import root_mean_square
from solver.integrators.one_step import OneStepIntegrator
from solver.scene import Criteria, Numerics, Scene, Shear, Vesicle
from solver.simulation.simulate import simulate
from tests.solver.scenes import shear_pair
from tests.solver.steps import FunctionEquation

Array = NDArray[np.float64]


@pytest.mark.parametrize(("vesicles", "expected"), [(1, OneStepIntegrator), (2, BackwardDifferentiation)])
def test_one_vesicle_takes_long_steps_and_several_many(vesicles: int, expected: type) -> None:
    equation = FunctionEquation(lambda y: -y, lambda _: -np.eye(2))
    found = integrator_for(InitialValueProblem(equation, np.ones(2), 0.0, 1.0), Numerics(), vesicles)
    assert isinstance(found, expected)


@pytest.mark.parametrize(
    ("numerics", "message"),
    [
        ({"order": 4}, "order can be chosen for integrator 'sdc' only, got 4 with 'auto'"),
        ({"integrator": "imex-euler", "order": 2}, "order can be chosen .* with 'imex-euler'"),
        ({"step_control": "area-length"}, "needs integrator 'sdc' or 'imex-euler', got 'auto'"),
        ({"integrator": "rosenbrock", "step_control": "area-length"}, "got 'rosenbrock'"),
        ({"integrator": "sdc", "order": 1}, r"order\n.*greater than or equal to 2"),
        ({"integrator": "sdc", "order": 9}, r"order\n.*less than or equal to 8"),
        ({"integrator": "rk4"}, r"integrator\n.*'auto', 'bdf', 'rosenbrock', 'sdc' or 'imex-euler'"),
        ({"integrator": "sdc", "step_control": "none"}, r"step_control\n.*'embedded' or 'area-length'"),
    ],
)
def test_combinations_that_do_not_exist_are_refused_by_name(
    numerics: dict[str, object], message: str
) -> None:
    with pytest.raises(ValidationError, match=message):
        Numerics.model_validate(numerics)


@pytest.mark.parametrize(
    ("integrator", "order"), [("rosenbrock", None), ("sdc", 2), ("sdc", 4), ("sdc", 5), ("imex-euler", None)]
)
def test_the_error_of_a_run_falls_with_the_tolerance(integrator: str, order: int | None) -> None:
    fields = {"horizon": 5.0}

    def final(**numerics: object) -> Array:
        run = simulate(
            shear_pair(1.5, numerics=Numerics.model_validate({"points": 32, **numerics}), **fields)
        )
        assert run.failure is None
        return np.append(run.frames.tangent_angle[-1], run.frames.center[-1])

    reference = final(tolerance=1e-9)
    errors = [
        root_mean_square(final(integrator=integrator, order=order, tolerance=tolerance) - reference)
        for tolerance in (1e-2, 1e-3, 1e-4)
    ]
    # Order 1 is judged by an estimate of order 2, so a hundredth of the tolerance is a tenth of the error.
    assert errors[0] > 1.5 * errors[1] > 1.5**2 * errors[2]
    assert errors[2] < (3e-2 if integrator == "imex-euler" else 2e-3)


@pytest.mark.parametrize("integrator", ["rosenbrock", "sdc"])
def test_period_of_a_doublet_in_shear(integrator: str) -> None:
    """Against the same reference as BDF's (test_published)."""
    numerics = Numerics.model_validate({"integrator": integrator, "tolerance": 1e-4})
    run = simulate(shear_pair(1.5, criteria=Criteria(revolutions=2), numerics=numerics))
    assert run.outcome is Outcome.BOUND
    assert run.period == pytest.approx(36.229, rel=3e-3)


def test_a_free_vesicle_comes_to_equilibrium() -> None:
    scene = Scene(horizon=500.0, vesicles=(Vesicle(reduced_area=0.7),))
    found = simulate(scene.model_copy(update={"numerics": Numerics(integrator="sdc", tolerance=1e-6)}))
    expected = simulate(scene.model_copy(update={"numerics": Numerics(integrator="bdf", tolerance=1e-6)}))
    assert found.outcome is expected.outcome is Outcome.EQUILIBRIUM
    assert found.energy.bending == pytest.approx(expected.energy.bending, rel=1e-5)


@pytest.mark.parametrize("order", [2, 4])
def test_step_control_by_area_and_length_bounds_their_drift(order: int) -> None:
    drift = []
    for tolerance in (1e-2, 1e-3):
        numerics = Numerics(
            points=64, integrator="sdc", order=order, step_control="area-length", tolerance=tolerance
        )
        run = simulate(shear_pair(1.5, numerics=numerics, horizon=30.0))
        assert run.failure is None
        assert run.time == 30.0
        assert run.error.area < 1.2 * tolerance
        drift.append(run.error.area)
    assert drift[1] < drift[0] / 4


def test_one_vesicle_treads_as_with_the_default() -> None:
    scene = Scene(horizon=40.0, vesicles=(Vesicle(),), flow=Shear(rate=0.5))
    angles = [
        simulate(scene.model_copy(update={"numerics": numerics})).inclination_angle
        for numerics in (
            Numerics(tolerance=1e-6),
            Numerics(integrator="bdf", tolerance=1e-6),
            Numerics(integrator="sdc", order=3, tolerance=1e-5),
        )
    ]
    assert angles[1:] == pytest.approx([angles[0]] * 2, abs=0.01)
