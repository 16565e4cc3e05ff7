"""Tables of backward differences: the history that backward differentiation keeps.

Row m of a table holds ∇ᵐy, the m-th backward difference of values at equal steps.  Rows up to the order k of
the formula are the polynomial of degree k through the last k + 1 values.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import comb

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled

Array = NDArray[np.float64]

MAX_ORDER = 5
ROWS = MAX_ORDER + 3  # the order may rise by one, for which one difference more is estimated


@compiled
def extrapolate(table: Array, weights: Array, value: Array, history: Array) -> None:
    """Write what a table says of the next value.

    Parameters
    ----------
    table : (ROWS, n)
    weights : (k,)
        Of the rows from the first difference on; their number is the order of the polynomial.
    value : (n,), written
        The polynomial, extrapolated by a step.
    history : (n,), written
        The sum of the weighted rows.
    """
    for j in range(value.size):
        value[j], history[j] = table[0, j], 0.0
    for row in range(weights.size):
        for j in range(value.size):
            value[j] += table[row + 1, j]
            history[j] += weights[row] * table[row + 1, j]


@compiled
def append(table: Array, order: int, difference: Array) -> None:
    """Append a value to a table, in place.

    Parameters
    ----------
    table : (ROWS, n)
    order : int
        Of the polynomial that was extrapolated to the new value.
    difference : (n,)
        Of the new value from the extrapolated one, which is ∇ᵏ⁺¹y.
    """
    for j in range(difference.size):
        table[order + 2, j] = difference[j] - table[order + 1, j]
        table[order + 1, j] = difference[j]
    for row in range(order, -1, -1):
        for j in range(difference.size):
            table[row, j] += table[row + 1, j]


def rescaling(order: int, factor: float) -> Array:
    """Return the matrix from differences to those of values at multiples of another step.

    Parameters
    ----------
    order : int
    factor : float
        Of the new step size to the old one.

    Returns
    -------
    (order + 1, order + 2)
        From the rows up to the order; the last column is for the first term that a polynomial of this order
        leaves out.
    """
    return _differences_of_values(order) @ _newton_weights(order, factor)


@compiled
def _newton_weights(order: int, factor: float) -> Array:
    """Return the weights of differences in the values at multiples of another step, (order + 1, order + 2).

    Row j is for the value j new steps back, by Newton's formula
    y(t + s·h) = Σₘ ∇ᵐy s(s + 1)…(s + m − 1)/m!.
    """
    weights = np.empty((order + 1, order + 2))
    for value in range(order + 1):
        weights[value, 0] = 1.0
        for row in range(order + 1):
            weights[value, row + 1] = weights[value, row] * (row - factor * value) / (row + 1)
    return weights


@compiled
def _value_at(table: Array, steps: float) -> Array:
    """Return the value of the polynomial (k + 1, n) some steps after the latest one, (n,)."""
    value = table[0].copy()
    weight = 1.0
    for row in range(1, table.shape[0]):
        weight *= (steps + row - 1) / row
        for j in range(value.size):
            value[j] += weight * table[row, j]
    return value


def combined(weights: Array, table: Array) -> Array:
    """Return sums of the rows of a table.

    Parameters
    ----------
    weights : (k,) or (m, k)
    table : (k, ...)

    Returns
    -------
    (...) or (m, ...)
    """
    rows = table.reshape(len(table), -1)  # a product of matrices; `np.tensordot` takes several times as long
    return np.asarray(weights @ rows).reshape(*weights.shape[:-1], *table.shape[1:])


@cache
def _differences_of_values(order: int) -> Array:
    """Return the matrix from values, the latest first, to their backward differences."""
    rows = range(order + 1)
    return np.array([[float((-1) ** value * comb(row, value)) for value in rows] for row in rows])


def interpolant(table: Array, order: int, time: float, size: float) -> Callable[[float], Array]:
    """Return the polynomial that the rows up to an order stand for.

    Parameters
    ----------
    table : (ROWS, ...)
        It may change afterwards.
    order : int
    time : float
        Of the latest value.
    size : float
        Of the steps.

    Returns
    -------
    callable
        From a time to the value there, (...).
    """
    rows, shape = table[: order + 1].reshape(order + 1, -1).copy(), table.shape[1:]

    def at(instant: float) -> Array:
        return np.asarray(_value_at(rows, (instant - time) / size)).reshape(shape)

    return at
