"""Closed curves of fixed length, given by tangent angle and center.

A curve of length L has the tangent angle θ at N points that are equispaced in arclength.  Its points are the
center plus the antiderivative of mean zero of (cos θ, sin θ).  The length is exact by construction.  Area and
closure are conserved only as accurately as the motion is computed (`solver.membrane.restoring`).
Curves run counterclockwise; the normal (−sin θ, cos θ) points inward.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.membrane.spectral import integration

Array = NDArray[np.float64]


def tangents(tangent_angle: Array) -> Array:
    """Return the unit tangents.

    Parameters
    ----------
    tangent_angle : (..., N)

    Returns
    -------
    (..., 2, N)
        Components x and y.
    """
    return np.stack([np.cos(tangent_angle), np.sin(tangent_angle)], axis=-2)


def positions(tangent_angle: Array, center: Array, length: float | Array) -> Array:
    """Return the points of the curves.

    Parameters
    ----------
    tangent_angle : (..., N)
    center : (..., 2)
    length : scalar or (...)
        Perimeter of each curve.

    Returns
    -------
    (..., 2, N)
        Components x and y.
    """
    matrix = integration(tangent_angle.shape[-1])
    scale = np.asarray(length)[..., None, None] / (2 * np.pi)
    points: Array = np.asarray(center)[..., None] + scale * (tangents(tangent_angle) @ matrix.T)
    return points


def area(points: Array, tangents: Array, length: float | Array) -> Array:
    """Return the enclosed area ½∮(x dy − y dx) of curves.

    It is taken about their centers, so a curve that does not quite close has the same area wherever it lies.

    Parameters
    ----------
    points, tangents : (..., 2, N)
    length : scalar or (...)
        Perimeter of each curve.

    Returns
    -------
    (...)
        Positive for a counterclockwise curve.
    """
    offsets = points - points.mean(axis=-1, keepdims=True)
    moment = offsets[..., 0, :] * tangents[..., 1, :] - offsets[..., 1, :] * tangents[..., 0, :]
    return 0.5 * np.asarray(length) * moment.mean(axis=-1)


def closure(tangents: Array) -> Array:
    """Return how far curves are from closing, relative to their length.

    Parameters
    ----------
    tangents : (..., 2, N)

    Returns
    -------
    (...)
        |∫(cos θ, sin θ) ds|/L.
    """
    mean = tangents.mean(axis=-1)
    return np.asarray(np.hypot(mean[..., 0], mean[..., 1]))


def inclination(points: Array) -> Array:
    """Return the angle of the long principal axis of curves against x.

    Parameters
    ----------
    points : (..., 2, N)

    Returns
    -------
    (...)
        Radians, in (−π/2, π/2].
    """
    offset = points - points.mean(axis=-1, keepdims=True)
    moments = offset @ offset.swapaxes(-1, -2)
    return np.asarray(0.5 * np.arctan2(2 * moments[..., 0, 1], moments[..., 0, 0] - moments[..., 1, 1]))
