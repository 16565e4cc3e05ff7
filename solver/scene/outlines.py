"""Where membranes lie as they start, and whether they overlap."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.scene.ellipses import semi_axes
from solver.scene.tangent_angles import points_of

if TYPE_CHECKING:
    from solver.scene.vesicle import Vesicle

ComplexArray = NDArray[np.complex128]

_POINTS = 128  # of the outline of an ellipse


def outline(vesicle: Vesicle) -> ComplexArray:
    """Return points of a membrane as it starts, x + iy.

    Parameters
    ----------
    vesicle : Vesicle

    Returns
    -------
    (n,)
    """
    if vesicle.tangent_angle is None:
        major, minor = semi_axes(vesicle.reduced_area, vesicle.length)
        angle = 2 * np.pi * np.arange(_POINTS) / _POINTS
        offsets = major * np.cos(angle) + 1j * minor * np.sin(angle)
    else:
        shape = np.array(vesicle.tangent_angle)
        offsets = points_of(shape, shape.size) * vesicle.length / (2 * np.pi)
    return np.asarray(complex(*vesicle.center) + np.exp(1j * vesicle.angle) * offsets)


def outlines_overlap(first: ComplexArray, second: ComplexArray) -> bool:
    """Return whether a point of one of two closed polygons lies within the other one.

    Parameters
    ----------
    first : (n,)
    second : (m,)

    Returns
    -------
    bool
    """
    return bool(_within(first, second).any() or _within(second, first).any())


def _within(points: ComplexArray, polygon: ComplexArray) -> NDArray[np.bool_]:
    """Return which points lie within a polygon: those around which it winds."""
    to_corners = polygon[None, :] - points[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        turns = np.angle(np.roll(to_corners, -1, axis=1) / to_corners).sum(axis=1) / (2 * np.pi)
    return np.asarray(np.abs(turns) > 0.5)
