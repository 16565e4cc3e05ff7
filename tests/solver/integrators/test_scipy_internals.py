"""The internals of SciPy's `BDF` that `solver.integrators.bdf` relies on.

If a test fails here after an update of SciPy, compare `scipy/integrate/_ivp/bdf.py` of both versions with the
comments of `SCIPY_INTERNALS`, mend `solver/integrators/bdf.py`, and move the bound in `pyproject.toml`.
"""

from __future__ import annotations

import ast
import inspect
from typing import Any

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray
from scipy.integrate import BDF

from solver.integrators import InitialValueProblem, bdf
from solver.integrators.bdf import SCIPY_INTERNALS, BackwardDifferentiation
from tests.solver.steps import OSCILLATOR_EQUATION, OSCILLATOR_START, oscillator, oscillator_jacobian

Array = NDArray[np.float64]

DOCUMENTED = {"dense_output", "status", "step", "t", "t_bound", "t_old", "y"}
CHANGED = f"SciPy {scipy.__version__} has changed what solver/integrators/bdf.py relies on: BDF."


def scipy_formulas(tolerance: float) -> Any:
    """SciPy's formulas as they are, but for the two tolerances."""
    formulas = BDF(
        lambda _, y: oscillator(y),
        0.0,
        OSCILLATOR_START,
        20.0,
        rtol=100 * np.finfo(float).eps,
        atol=tolerance,
        jac=lambda _, y: oscillator_jacobian(y),
    )
    formulas.rtol, formulas.newton_tol = 0.0, 0.1
    return formulas


@pytest.mark.parametrize("name", SCIPY_INTERNALS)
def test_they_exist(name: str) -> None:
    assert hasattr(scipy_formulas(1e-6), name), f"{CHANGED}{name} is gone"


def test_they_are_all_that_is_used() -> None:
    used = {
        node.attr
        for node in ast.walk(ast.parse(inspect.getsource(bdf)))
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) in ("bdf", "self._bdf")
    }
    assert used - DOCUMENTED == set(SCIPY_INTERNALS)


def test_the_history_begins_with_the_rate_times_the_step_size() -> None:
    formulas = scipy_formulas(1e-6)
    expected = formulas.h_abs * oscillator(OSCILLATOR_START)
    np.testing.assert_allclose(formulas.D[1], expected, rtol=1e-15, err_msg=f"{CHANGED}D[1]")


def test_the_error_constants_are_those_of_the_formulas() -> None:
    """κ γ_k + 1/(k + 1) for the orders k = 1 to 5 (Shampine & Reichelt 1997, section 2)."""
    kappa = np.array([-0.185, -1 / 9, -0.0823, -0.0415, 0.0])
    order = np.arange(1, 6)
    expected = kappa * np.cumsum(1 / order) + 1 / (order + 1)
    found = scipy_formulas(1e-6).error_const[1:]
    np.testing.assert_allclose(found, expected, rtol=1e-14, err_msg=f"{CHANGED}error_const")


@pytest.mark.parametrize("tolerance", [1e-4, 1e-8])
def test_what_is_replaced_does_what_scipy_does(tolerance: float) -> None:
    """Steps, Jacobians and factorizations are those of SciPy's own linear algebra."""
    theirs = scipy_formulas(tolerance)
    problem = InitialValueProblem(OSCILLATOR_EQUATION, OSCILLATOR_START, 0.0, 20.0)
    ours = BackwardDifferentiation(problem, tolerance)
    replaced = f"{CHANGED}I, J, jac, lu, solve_lu, newton_tol or rtol"
    while theirs.status == "running":
        theirs.step()
        step = ours.step()
        assert step.end == pytest.approx(theirs.t, rel=1e-10), replaced
        np.testing.assert_allclose(step.state, theirs.y, rtol=0, atol=1e-10, err_msg=replaced)
    assert (ours.jacobian_evaluations, ours.factorizations) == (theirs.njev, theirs.nlu), replaced
