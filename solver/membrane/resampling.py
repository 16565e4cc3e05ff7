"""The same membranes with another number of points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.membrane.spectral import equispaced_angles, resampled

if TYPE_CHECKING:
    from solver.membrane.geometry import Membranes

Array = NDArray[np.float64]


def resampled_angle(tangent_angle: Array, points: int) -> Array:
    """Interpolate tangent angles trigonometrically.

    Parameters
    ----------
    tangent_angle : (..., N)
    points : int
        If fewer than N, waves that they cannot tell apart are left out.

    Returns
    -------
    (..., points)
        Tangent angles of the same curves.
    """
    given = tangent_angle.shape[-1]
    if points == given:
        return tangent_angle
    coarse, fine = (equispaced_angles(n) for n in (given, points))
    return resampled(tangent_angle - coarse, points) + fine


def resampled_state(membranes: Membranes, state: Array, finer: Membranes) -> Array:
    """Interpolate a state to more points.

    Parameters
    ----------
    membranes : Membranes
    state : (state_size,)
        Of these membranes.
    finer : Membranes
        The same vesicles with at least as many points.

    Returns
    -------
    (finer.state_size,)
        With the clock if the state has one.
    """
    angle = resampled_angle(membranes.tangent_angle(state), finer.points)
    return np.concatenate([finer.pack(angle, membranes.center(state)), state[membranes.state_size :]])
