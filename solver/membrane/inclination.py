"""The inclination of curves that is asked for at every step: by their tangent angles alone, and compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.membrane.products import multiply_both
from solver.membrane.spectral import integration

Array = NDArray[np.float64]


def inclination_by_angle(tangent_angle: Array) -> Array:
    """Return the `curve.inclination` of curves of which only the tangent angles are known.

    Parameters
    ----------
    tangent_angle : (M, N)

    Returns
    -------
    (M,)
        Radians, in (−π/2, π/2].
    """
    angles = np.empty(len(tangent_angle))
    _write_inclinations(tangent_angle, integration(tangent_angle.shape[1]), angles)
    return angles


@compiled
def _write_inclinations(tangent_angle: Array, integration: Array, angles: Array) -> None:
    """Write `inclination_by_angle` with the matrix of `integration`, whose results have no mean."""
    size = tangent_angle.shape[1]
    tx, ty, x, y = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    for vesicle in range(angles.size):
        for j in range(size):
            tx[j], ty[j] = np.cos(tangent_angle[vesicle, j]), np.sin(tangent_angle[vesicle, j])
        multiply_both(integration, tx, ty, x, y)
        difference = mixed = 0.0
        for j in range(size):
            difference += x[j] * x[j] - y[j] * y[j]
            mixed += x[j] * y[j]
        angles[vesicle] = 0.5 * np.arctan2(2.0 * mixed, difference)
