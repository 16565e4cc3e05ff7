"""The error in space that a state has, estimated from the spectra of its shapes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.membrane.spectral import equispaced_angles, tail

if TYPE_CHECKING:
    from solver.membrane.geometry import Membranes

Array = NDArray[np.float64]

# Measured: position errors of runs converged in time, against the tails of their spectra, lie at or below
# 250·tail³ where the start's tail is the largest, and below 60·tail^1.5 where one persists.
_STARTING, _PERSISTING = 300.0, 100.0


def shape_tails(membranes: Membranes, state: Array) -> Array:
    """Return the amplitude of the last third of the spectrum of each vesicle's tangent angle.

    Parameters
    ----------
    membranes : Membranes
    state : (state_size,)

    Returns
    -------
    (M,)
        Radians; see `solver.membrane.spectral.tail`.
    """
    return tail(membranes.tangent_angle(state) - equispaced_angles(membranes.points))


def spatial_error(tails: Array, age: Array) -> Array:
    """Estimate the errors of positions that the tails of spectra stand for (README, S11).

    Bending smooths the tips of a slender ellipse within a moment, so that the error they leave is little more
    than that of their sampling.  A tail that forces renew does harm for as long as they act.

    Parameters
    ----------
    tails : (M,)
        See `shape_tails`.
    age : (M,)
        Time since the start, in units of that in which forces change the shapes.

    Returns
    -------
    (M,)
        In units of length.
    """
    return np.asarray(_STARTING * tails**3 + _PERSISTING * tails**1.5 * np.minimum(age, 1.0))
