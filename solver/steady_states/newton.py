"""Newton's method for steady states."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, lstsq

from solver.forces.tension import TensionNotFoundError

if TYPE_CHECKING:
    from solver.steady_states.steady_equations import SteadyEquations

Array = NDArray[np.float64]

# Converged is a correction below this, in radians and lengths: the next one would be its square.
_CONVERGED = 1e-9
_ITERATIONS = 12
_RANK = 1e-13  # slow motions count: along them the closest steady state may be far
_LARGEST_CORRECTION = 1.0  # a longer one leads to another state, if to any


class NoSteadyStateError(ArithmeticError):
    """Newton's method finds no steady state near a state; the message says why."""


def steady_state(equations: SteadyEquations, state: Array) -> Array:
    """Find the steady state near a state.

    Parameters
    ----------
    equations : SteadyEquations
    state : (n,)

    Returns
    -------
    (n,)

    Raises
    ------
    NoSteadyStateError
        If the iteration does not converge.
    """
    for _ in range(_ITERATIONS):
        step = correction(equations, state)
        state = state + step
        if np.abs(step).max() < _CONVERGED:
            return state
    raise NoSteadyStateError(f"no steady state is near: {_ITERATIONS} Newton steps do not converge")


def correction(equations: SteadyEquations, state: Array) -> Array:
    """Return the step of Newton's method from a state towards a steady one.

    Parameters
    ----------
    equations : SteadyEquations
    state : (n,)

    Returns
    -------
    (n,)

    Raises
    ------
    NoSteadyStateError
        If there is no step, or a long one.
    """
    try:
        rows = np.concatenate(equations.linearization(state))
        step = least_squares(rows, -equations.residual(state), _RANK)
    except TensionNotFoundError as error:
        raise NoSteadyStateError(f"no steady state is near: {error}") from error
    longest = float(np.abs(step).max())
    if longest > _LARGEST_CORRECTION:
        raise NoSteadyStateError(f"no steady state is near: the closest may be {longest:.1e} away")
    return step


def least_squares(rows: Array, right: Array, rank: float) -> Array:
    """Solve consistent equations, of which there are more than unknowns.

    Parameters
    ----------
    rows : (k, n)
    right : (k,)
    rank : float
        Relative size of the singular values below which the equations leave a choice.

    Returns
    -------
    (n,)
        The shortest solution where the equations leave a choice.

    Raises
    ------
    NoSteadyStateError
        If they hold what is no number.
    """
    try:
        return np.asarray(lstsq(rows, right, cond=rank)[0])
    except (LinAlgError, ValueError) as error:
        raise NoSteadyStateError(f"no steady state is near: {error}") from error
