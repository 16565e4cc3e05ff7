"""Products of small matrices with vectors, inside compiled functions.

At the sizes of a membrane plain loops take no longer than BLAS, need no temporary arrays, and compile faster.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled, widest_vectors

Array = NDArray[np.float64]


@compiled
def multiply(matrix: Array, vector: Array, out: Array) -> None:
    """Write the product of a matrix with a vector.

    Parameters
    ----------
    matrix : (m, n)
        With an even number of rows.
    vector : (n,)
    out : (m,)
        Written to.
    """
    widest_vectors()
    for i in range(0, out.size, 2):
        row, next_row = matrix[i], matrix[i + 1]
        total = 0.0
        next_total = 0.0
        for j in range(vector.size):
            total += row[j] * vector[j]
            next_total += next_row[j] * vector[j]
        out[i], out[i + 1] = total, next_total


@compiled
def multiply_both(matrix: Array, x: Array, y: Array, out_x: Array, out_y: Array) -> None:
    """Write the products of a matrix with both components of a vector field.

    Parameters
    ----------
    matrix : (m, n)
    x, y : (n,)
    out_x, out_y : (m,)
        Written to.
    """
    widest_vectors()
    for i in range(out_x.size):
        row = matrix[i]
        total_x = 0.0
        total_y = 0.0
        for j in range(x.size):
            total_x += row[j] * x[j]
            total_y += row[j] * y[j]
        out_x[i], out_y[i] = total_x, total_y


@compiled
def sum_rows(weights: Array, matrix: Array, out: Array) -> None:
    """Write the sum of the rows of a matrix, each times a weight.

    Parameters
    ----------
    weights : (m,)
    matrix : (m, n)
    out : (n,)
        Written to.
    """
    for j in range(out.size):
        out[j] = 0.0
    for i in range(weights.size):
        row, weight = matrix[i], weights[i]
        for j in range(out.size):
            out[j] += weight * row[j]


@compiled
def project_out(modes: Array, vector: Array) -> None:
    """Take off the part of a vector that lies in the span of modes, in place.

    Parameters
    ----------
    modes : (n, k)
        An orthonormal basis.
    vector : (n,)
        Changed in place.
    """
    for k in range(modes.shape[1]):
        share = 0.0
        for j in range(vector.size):
            share += modes[j, k] * vector[j]
        for j in range(vector.size):
            vector[j] -= share * modes[j, k]
