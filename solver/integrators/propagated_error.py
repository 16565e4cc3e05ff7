"""The error that the steps of backward differentiation have left in the state.

A formula of order k leaves the local error C ∇ᵏ⁺¹y in every step.  To first order the error e = y − y_exact
obeys the linearized equation of motion with these as its source.  The same formula solves it, with the same
steps and the matrix in hand.

The Jacobian in hand may be several steps old, and then errors grow or die out at another rate than the
motion's.  In the first two steps with it, it is taken as it is.  In every third one a difference of two rates
shows what it does to the error now, and until the next one the Jacobian is taken to be wrong in the direction
of that error only.

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

import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.integrators.backward_differences import (
    ROWS,
    append,
    combined,
    extrapolate,
    interpolant,
)
from solver.integrators.control import root_mean_square

if TYPE_CHECKING:
    from solver.memory import Saved
    from solver.motion.jacobian import Jacobian

Array = NDArray[np.float64]

_PROBED_EVERY = 3  # steps with a Jacobian; more often costs more and, measured over 60 scenes, gains nothing
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

    direction: Array
    rate: Array

    def __matmul__(self, direction: Array) -> Array:
        share = (self.direction @ direction) / (self.direction @ self.direction)
        return np.multiply.outer(self.rate, share)


@compiled
def amounts_along(directions: Array, errors: Array, first: int = 0) -> Array:
    """Find how much of each direction is in errors, by least squares.

    The last direction comes first (Gram & Schmidt), and none is taken that later ones make up.

    Parameters
    ----------
    directions : (m, n)
    errors : (n, 2)
    first : int
        Directions before it are left out.

    Returns
    -------
    (m, 2)
    """
    count, size = directions.shape
    apart, squares, shares = directions.copy(), np.zeros(count), np.zeros((count, count))
    amounts = np.zeros((count, 2))
    for k in range(count - 1, first - 1, -1):
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
        for k in range(first, count):
            if squares[k] > 0.0:
                for i in range(size):
                    amounts[k, column] += apart[k, i] * errors[i, column] / squares[k]
                for other in range(first, k):
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


@compiled
def complete_source(
    duration: float, local_error: Array, sign: float, history: Array, right_side: Array
) -> None:
    """Turn the rates of both errors into the right-hand sides of their steps, in place.

    Parameters
    ----------
    duration : float
        See `LinearizedStep`.
    local_error : (n,)
        The source of the first error.
    sign : float
        With which it is that of the second one.
    history : (n, 2)
        What the table of the errors contributes.
    right_side : (n, 2), changed
        Rates on entry.
    """
    for i in range(local_error.size):
        first, second = duration * right_side[i, 0], duration * right_side[i, 1]
        right_side[i, 0] = first + local_error[i] - history[i, 0]
        right_side[i, 1] = second + sign * local_error[i] - history[i, 1]


@compiled
def separate(first: int, table: Array, directions: Array, amounts: Array) -> tuple[float, float]:
    """Take to the amounts what errors have in the directions.

    Parameters
    ----------
    first : int
        The first direction in which that is done.  Those before it have no part in the motion now; their
        amounts are given back to the errors.
    table : (ROWS, n, 2), changed
    directions : (ROWS, m, n)
    amounts : (m, 2), changed

    Returns
    -------
    (float, float)
        The largest element of each of the whole errors.
    """
    count, size = directions.shape[1:]
    found = amounts_along(directions[0], table[0], first)
    more = np.empty((count, 2))
    for k in range(count):
        for column in range(2):
            more[k, column] = amounts[k, column] if k < first else -found[k, column]
            amounts[k, column] -= more[k, column]
    _add_along(directions, more, table)
    first_largest = second_largest = 0.0
    for i in range(size):
        first_whole, second_whole = table[0, i, 0], table[0, i, 1]
        for k in range(count):
            first_whole += amounts[k, 0] * directions[0, k, i]
            second_whole += amounts[k, 1] * directions[0, k, i]
        first_largest = max(first_largest, abs(first_whole))
        second_largest = max(second_largest, abs(second_whole))
    return first_largest, second_largest


def _flat(table: Array) -> Array:
    """Return a view of a table whose rows are vectors."""
    return table.reshape(len(table), -1)


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
    begin : float
        When the integration begins.  The signs depend on it: parts of a run that begin alike draw others.
    """

    def __init__(self, rate: Callable[[Array], Array], error: Array, directions: Array, begin: float) -> None:
        self._rate, self._begin = rate, begin
        self._table = np.zeros((ROWS, *error.shape))  # of the rest of the errors
        self._table[0] = error
        self._directions = np.zeros((ROWS, *directions.shape[1:]))
        self._directions[: len(directions)] = directions
        self._amounts = np.zeros((directions.shape[1], 2))  # of the errors in these directions
        self._jacobian: Jacobian | None = None  # of the last step
        self._age = 0  # steps with it
        self._deviation: _Deviation | None = None  # what it leaves out
        self._random, self._sources = random.Random(begin), 0

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
        deviation = self._deviation if self._jacobian is jacobian else None
        return {
            "table": self._table.copy(),
            "directions": self._directions.copy(),
            "amounts": self._amounts.copy(),
            "age": self._age if self._jacobian is jacobian else 0,
            "deviation": (deviation.direction.copy(), deviation.rate.copy()) if deviation else None,
            "sources": self._sources,
        }

    def restore(self, saved: Saved, jacobian: Jacobian) -> None:
        """Go on where another one was.

        Parameters
        ----------
        saved : dict
        jacobian : Jacobian
            The same as that with which it was saved.
        """
        self._table = saved["table"].copy()
        self._random, self._sources = random.Random(self._begin), 0
        while self._sources < saved["sources"]:
            self._sign()
        self._directions, self._amounts = saved["directions"].copy(), saved["amounts"].copy()
        self._jacobian, self._age = jacobian, saved["age"]
        self._deviation = None
        if saved["deviation"]:
            direction, rate = saved["deviation"]
            self._deviation = _Deviation(direction, rate)

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
        predicted, history = np.empty((2, *self._table.shape[1:]))
        extrapolate(_flat(self._table), step.weights, predicted.ravel(), history.ravel())
        sign, right_side = self._sign(), step.jacobian @ predicted
        complete_source(step.duration, local_error, sign, history, right_side)
        change = step.solve(right_side)
        self._grow_older(step.jacobian)
        if self._age % _PROBED_EVERY == 0:
            self._deviation = self._probe(step.jacobian, predicted[:, 0] + change[:, 0], near)
        if self._deviation:
            change = change + step.solve(step.duration * (self._deviation @ (predicted + change)))
        moved = step.duration * root_mean_square(directions[0])
        entered = np.multiply.outer(remainder, (1.0, sign))
        entered += change
        append(_flat(self._table), step.order, entered.ravel())
        expected = np.empty((2, directions.size))
        extrapolate(_flat(self._directions), step.weights, *expected)
        append(_flat(self._directions), step.order, directions.ravel() - expected[0])
        first = 0 if moved > _MOVES * root_mean_square(local_error) else 1
        largest = separate(first, self._table, self._directions, self._amounts)
        if max(largest) > _LOST:  # it would grow until it overflows
            part = _LOST / np.maximum(largest, _LOST)
            self._table *= part
            self._amounts *= part

    def _grow_older(self, jacobian: Jacobian) -> None:
        """Count the steps with a Jacobian."""
        if jacobian is not self._jacobian:
            self._jacobian, self._age, self._deviation = jacobian, 0, None
        self._age += 1

    def _whole(self, rows: int) -> Array:
        """Return the first rows of the table of the whole errors, (rows, n, 2)."""
        whole = self._table[:rows].copy()
        _add_along(self._directions[:rows], self._amounts, whole)
        return whole

    def _sign(self) -> float:
        """Return the sign of a source of the second error."""
        self._sources += 1
        return 1.0 if self._random.random() < 0.5 else -1.0  # it draws the same in every version of Python

    def _probe(self, jacobian: Jacobian, error: Array, near: Evaluation) -> _Deviation | None:
        size = root_mean_square(error)
        if size == 0:
            return None
        scale = min(max(size, _LEAST_PROBE), _LARGEST_PROBE) / size
        try:
            rate = (near.rate - self._rate(near.state - scale * error)) / scale
        except ArithmeticError:
            return None
        return _Deviation(error, rate - jacobian @ error)

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
        lost = np.multiply.outer(left_out, (1.0, self._sign()))
        self._table[: order + 1] -= matrix[:, -1, None, None] * lost
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
