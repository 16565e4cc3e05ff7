"""The error of positions that an error of the state stands for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.membrane import curve

if TYPE_CHECKING:
    from solver.membrane.geometry import Membranes

Array = NDArray[np.float64]


_DOUBT = 0.5  # share of the usual size of an error by which its estimate may be off; measured


def magnitude(error: Array) -> float:
    """Return what is reported of an error.

    Parameters
    ----------
    error : (2,)
        Its estimate, and the size that it would usually have (`solver.integrators.Step`).

    Returns
    -------
    float
    """
    return float(np.hypot(error[0], _DOUBT * error[1]))


def position_error(membranes: Membranes, state: Array, error: Array) -> float:
    """Return the root mean square of the distances between points with and without an error of the state.

    Parameters
    ----------
    membranes : Membranes
    state : (state_size,)
    error : (state_size, 2)
        Its columns are those of `magnitude`.

    Returns
    -------
    float
        In units of length.
    """

    def positions(each: Array) -> Array:
        return curve.positions(membranes.tangent_angle(each), membranes.center(each), membranes.length)

    given = positions(state)
    distances = [
        np.sqrt(np.sum((given - positions(state - column)) ** 2, axis=-2).mean()) for column in error.T
    ]
    return magnitude(np.array(distances))
