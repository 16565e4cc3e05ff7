"""The error of positions that an error of the state stands for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.membrane import curve

if TYPE_CHECKING:
    from solver.membrane.geometry import Membranes

Array = NDArray[np.float64]


def position_error(membranes: Membranes, state: Array, error: Array) -> float:
    """Return the root mean square of the distances between points with and without an error of the state.

    Parameters
    ----------
    membranes : Membranes
    state, error : (state_size,)

    Returns
    -------
    float
        In units of length.
    """
    with_error, without = (
        curve.positions(membranes.tangent_angle(each), membranes.center(each), membranes.length)
        for each in (state, state - error)
    )
    return float(np.sqrt(np.sum((with_error - without) ** 2, axis=-2).mean()))
