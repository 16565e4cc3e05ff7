"""The error that the steps of backward differentiation have left in the state.

A formula of order k leaves the local error C ∇ᵏ⁺¹y in every step.  To first order the error e = y − y_exact
obeys the linearized equation of motion with these as its source.  The same formula solves it, with the same
steps and the matrix in hand.

The Jacobian in hand may be several steps old, and then errors grow or die out at another rate than the
motion's.  So in every third step a difference of two rates shows what it does to the error now, and until
the next one the Jacobian is taken to be wrong in the direction of that error only.

Some errors neither grow nor die out: how far the state is ahead of the exact motion in time, and what the
symmetries of the equation of motion allow (`DifferentialEquation.symmetries`).  They are a number each times
a direction that is known at all times, such as a lead τ times the slope dy/dt, which grows and shrinks by
factors of hundreds.  Computed step by step such an error would turn a little into other directions each time,
and grow there like an instability.  So the numbers are kept, and only the rest of the error, d in
e = τ dy/dt + … + d, obeys the linearized equation.  After every step what d has in these directions goes to
the numbers.

Local errors of opposite signs may cancel by chance, and then what is wrong with each of them does not.  So
the same is done for a second error, whose sources have random signs: the size that it would usually have.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.integrators.backward_differences import (
    ROWS,
    combined,
    extended,
    interpolant,
)
from solver.integrators.control import root_mean_square

if TYPE_CHECKING:
    from solver.memory import Saved
    from solver.motion.jacobian import Jacobian

Array = NDArray[np.float64]

_PROBED_EVERY = 3  # steps; more often costs more and, measured over eight scenes, gains nothing
# Far beyond every state: an error as large says that nothing is known.  In a motion that never repeats
# itself it would go on to grow until it overflows.
_LOST = 1e9
# Root mean square; differences of rates would be noise if they were smaller, and not linear if larger.
_LEAST_PROBE, _LARGEST_PROBE = 1e-3, 1e-2
# Where a step moves the state by less than this multiple of its local error, as at rest, its slope is noise.
_MOVES = 10.0
_PARALLEL = 1e-6  # directions whose angle is smaller are one


class LinearizedStep(NamedTuple):
    """A step of y − y_predicted + Σₘ wₘ ∇ᵐy = c·f(y), with a linear f.

    Attributes
    ----------
    order : int
        Order k of the formula.
    weights : (k,)
        The weights w.
    duration : float
        The duration c.
    jacobian : Jacobian
        The derivative J of f.
    solve : callable
        From a right-hand side b to the solution x of (I − c·J) x = b.
    """

    order: int
    weights: Array
    duration: float
    jacobian: Jacobian
    solve: Callable[[Array], Array]


class Evaluation(NamedTuple):
    """A rate that is known.

    Attributes
    ----------
    state, rate : (n,)
    """

    state: Array
    rate: Array


@dataclass(frozen=True)
class _Deviation:
    """What a Jacobian leaves out: a rate for one direction, nothing for those orthogonal to it."""

    jacobian: Jacobian
    direction: Array
    rate: Array

    def __matmul__(self, direction: Array) -> Array:
        share = (self.direction @ direction) / (self.direction @ self.direction)
        return np.multiply.outer(self.rate, share)


@compiled
def amounts_along(directions: Array, errors: Array) -> Array:
    """Find how much of each direction is in errors, by least squares.

    The last direction comes first (Gram & Schmidt), and none is taken that later ones make up.

    Parameters
    ----------
    directions : (m, n)
    errors : (n, 2)

    Returns
    -------
    (m, 2)
    """
    count, size = directions.shape
    apart, squares, shares = directions.copy(), np.zeros(count), np.zeros((count, count))
    amounts = np.zeros((count, 2))
    for k in range(count - 1, -1, -1):
        whole = 0.0
        for i in range(size):
            whole += apart[k, i] ** 2
        for other in range(count - 1, k, -1):
            if squares[other] > 0.0:
                for i in range(size):
                    shares[k, other] += apart[other, i] * apart[k, i] / squares[other]
                for i in range(size):
                    apart[k, i] -= shares[k, other] * apart[other, i]
        for i in range(size):
            squares[k] += apart[k, i] ** 2
        if squares[k] <= _PARALLEL**2 * whole:
            squares[k] = 0.0
    for column in range(2):
        for k in range(count):
            if squares[k] > 0.0:
                for i in range(size):
                    amounts[k, column] += apart[k, i] * errors[i, column] / squares[k]
                for other in range(k):
                    amounts[k, column] -= shares[other, k] * amounts[other, column]
    return amounts


@compiled
def _add_along(directions: Array, amounts: Array, table: Array) -> None:
    """Add amounts (m, 2) of directions (rows, m, n) to a table (rows, n, 2)."""
    for row in range(table.shape[0]):
        for k in range(amounts.shape[0]):
            for i in range(table.shape[1]):
                table[row, i, 0] += amounts[k, 0] * directions[row, k, i]
                table[row, i, 1] += amounts[k, 1] * directions[row, k, i]


class PropagatedError:
    """The estimated error of the state, as tables of backward differences beside that of the state.

    Parameters
    ----------
    rate : callable
        From a state (n,) to its rate (n,).
    error : (n, 2)
        Of the state in which the integration begins: the estimate, and the one with random signs.
    directions : (2, 1 + m, n)
        In which errors stay: the slope of the state, and m symmetries; and their first backward difference.
    """

    def __init__(self, rate: Callable[[Array], Array], error: Array, directions: Array) -> None:
        self._rate = rate
        self._table = np.zeros((ROWS, *error.shape))  # of the rest of the errors
        self._table[0] = error
        self._directions = np.zeros((ROWS, *directions.shape[1:]))
        self._directions[: len(directions)] = directions
        self._amounts = np.zeros((directions.shape[1], 2))  # of the errors in these directions
        self._steps = 0
        self._deviation: _Deviation | None = None
        self._random = np.random.default_rng(0)

    def saved(self, jacobian: Jacobian) -> Saved:
        """Return what decides the errors to come.

        Parameters
        ----------
        jacobian : Jacobian
            Of the last step.  What another one leaves out is of no use any more.

        Returns
        -------
        dict
        """
        deviation = self._deviation
        if deviation and deviation.jacobian is not jacobian:
            deviation = None
        return {
            "table": self._table.copy(),
            "directions": self._directions.copy(),
            "amounts": self._amounts.copy(),
            "steps": self._steps,
            "deviation": (deviation.direction.copy(), deviation.rate.copy()) if deviation else None,
            "random": json.dumps(self._random.bit_generator.state),  # it holds integers of 128 bits
        }

    def restore(self, saved: Saved, jacobian: Jacobian) -> None:
        """Go on where another one was.

        Parameters
        ----------
        saved : dict
        jacobian : Jacobian
            The same as that with which it was saved.
        """
        self._table, self._steps = saved["table"].copy(), saved["steps"]
        self._directions, self._amounts = saved["directions"].copy(), saved["amounts"].copy()
        self._deviation = None
        if saved["deviation"]:
            direction, rate = saved["deviation"]
            # A column in memory, as the error is that was probed: its products are then the same to the bit.
            self._deviation = _Deviation(jacobian, np.stack([direction, direction], axis=1)[:, 0], rate)
        self._random.bit_generator.state = json.loads(saved["random"])

    def advance(
        self, step: LinearizedStep, directions: Array, local_error: Array, remainder: Array, near: Evaluation
    ) -> None:
        """Follow one step.

        Parameters
        ----------
        step : LinearizedStep
        directions : (1 + m, n)
            Those in which errors stay, at the end.
        local_error : (n,)
            What the formula leaves out of its right-hand side.
        remainder : (n,)
            How far the accepted state is from the solution of the formula.
        near : Evaluation
            Close to the accepted state.
        """
        table, order = self._table, step.order
        predicted = table[: order + 1].sum(axis=0)
        history = combined(step.weights, table[1 : order + 1])
        signs = self._signs()
        source = local_error[:, None] * signs - history
        change = step.solve(step.duration * (step.jacobian @ predicted) + source)
        error = predicted + change
        self._steps += 1
        if self._steps % _PROBED_EVERY == 0:
            self._deviation = self._probe(step.jacobian, error[:, 0], near)
        if self._deviation and self._deviation.jacobian is step.jacobian:
            change = change + step.solve(step.duration * (self._deviation @ error))
        extended(table, order, change + remainder[:, None] * signs)
        extended(self._directions, order, directions - self._directions[: order + 1].sum(axis=0))
        moved = step.duration * root_mean_square(directions[0])
        self._separate(moves=moved > _MOVES * root_mean_square(local_error))
        if self._steps % _PROBED_EVERY == 0:
            largest = np.abs(self._whole(1)).max(axis=(0, 1))
            if largest.max() > _LOST:
                part = np.minimum(1.0, _LOST / largest)
                table *= part
                self._amounts *= part

    def _separate(self, moves: bool) -> None:
        """Take what the rest of the errors has in the directions to the amounts.

        Where nothing moves, the lead is given back to the rest.
        """
        first = 0 if moves else 1
        more = -self._amounts
        more[first:] = amounts_along(self._directions[0, first:], self._table[0])
        _add_along(self._directions, -more, self._table)
        self._amounts += more

    def _whole(self, rows: int) -> Array:
        """Return the first rows of the table of the whole errors, (rows, n, 2)."""
        whole = self._table[:rows].copy()
        _add_along(self._directions[:rows], self._amounts, whole)
        return whole

    def _signs(self) -> Array:
        """Return the signs of a source, (2,)."""
        return np.array([1.0, 2.0 * self._random.integers(2) - 1.0])

    def _probe(self, jacobian: Jacobian, error: Array, near: Evaluation) -> _Deviation | None:
        size = root_mean_square(error)
        if size == 0:
            return None
        scale = min(max(size, _LEAST_PROBE), _LARGEST_PROBE) / size
        try:
            rate = (near.rate - self._rate(near.state - scale * error)) / scale
        except ArithmeticError:
            return None
        return _Deviation(jacobian, error, rate - jacobian @ error)

    def rescale(self, order: int, matrix: Array, left_out: Array) -> None:
        """Change the step size.

        Values between the old ones come from a polynomial, which has an error of its own.

        Parameters
        ----------
        order : int
            Order k of the polynomial.
        matrix : (k + 1, k + 2)
            See `rescaling`.
        left_out : (n,)
            ∇ᵏ⁺¹y of the state, in the old step size.
        """
        self._table[: order + 1] = combined(matrix[:, :-1], self._table[: order + 1])
        self._table[: order + 1] -= matrix[:, -1, None, None] * left_out[:, None] * self._signs()
        self._directions[: order + 1] = combined(matrix[:, :-1], self._directions[: order + 1])

    def interpolant(self, order: int, time: float, size: float) -> Callable[[float], Array]:
        """Return the error between steps; see `interpolant` of `backward_differences`.

        Parameters
        ----------
        order : int
        time : float
        size : float

        Returns
        -------
        callable
        """
        return interpolant(self._whole(order + 1), order, time, size)
