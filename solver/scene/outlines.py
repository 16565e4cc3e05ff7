"""Where membranes lie as they start, and whether they overlap."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.scene.ellipses import semi_axes
from solver.scene.tangent_angles import closed_of_reduced_area, points_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.scene.start import RandomWaves
    from solver.scene.vesicle import Vesicle

Array = NDArray[np.float64]
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
    if vesicle.tangent_angle is not None:
        return outline_of(vesicle, np.array(vesicle.tangent_angle))
    major, minor = semi_axes(vesicle.reduced_area, vesicle.length)
    angle = 2 * np.pi * np.arange(_POINTS) / _POINTS
    offsets = major * np.cos(angle) + 1j * minor * np.sin(angle)
    return np.asarray(complex(*vesicle.center) + np.exp(1j * vesicle.angle) * offsets)


def outline_of(vesicle: Vesicle, tangent_angle: Array) -> ComplexArray:
    """Return points of a membrane with given tangent angles, turned and placed as a vesicle is.

    Parameters
    ----------
    vesicle : Vesicle
    tangent_angle : (n,)

    Returns
    -------
    (n,)
    """
    offsets = points_of(tangent_angle, tangent_angle.size) * vesicle.length / (2 * np.pi)
    return np.asarray(complex(*vesicle.center) + np.exp(1j * vesicle.angle) * offsets)


def deformed_angles(vesicle: Vesicle, index: int, waves: RandomWaves) -> Array:
    """Return the tangent angles of a vesicle that random waves have deformed.

    Parameters
    ----------
    vesicle : Vesicle
    index : int
        Of the vesicle.
    waves : RandomWaves

    Returns
    -------
    (n,)
        Radians, at points equispaced in arclength, of the vesicle before it is turned.
    """
    along = 2 * np.pi * np.arange(_POINTS) / _POINTS
    if vesicle.tangent_angle is None:
        angles = _ellipse_angles(vesicle, along)
    else:
        given = np.array(vesicle.tangent_angle)
        places = 2 * np.pi * np.arange(given.size) / given.size
        angles = along + np.interp(along, places, given - places, period=2 * np.pi)
    return closed_of_reduced_area(angles + waves.change(index, _POINTS), vesicle.reduced_area)


def _ellipse_angles(vesicle: Vesicle, along: Array) -> Array:
    """Return the tangent angles of an ellipse from its tip on, at fractions of its length over 2π."""
    major, minor = semi_axes(vesicle.reduced_area, vesicle.length)
    parameter = np.linspace(0, 2 * np.pi, 32 * _POINTS + 1)
    tangents = -major * np.sin(parameter) + 1j * minor * np.cos(parameter)
    speed = np.abs(tangents)
    arclength = np.concatenate([[0.0], np.cumsum(speed[1:] + speed[:-1])])
    at = np.interp(along / (2 * np.pi), arclength / arclength[-1], parameter)
    return np.unwrap(np.angle(-major * np.sin(at) + 1j * minor * np.cos(at)))


def overlapping_outlines(
    vesicles: Sequence[Vesicle], outlines: Sequence[ComplexArray]
) -> tuple[int, int] | None:
    """Return the indices of two vesicles of which one has a point of its outline within the other one.

    Parameters
    ----------
    vesicles : sequence of Vesicle
    outlines : sequence of complex (n,)
        One for each.

    Returns
    -------
    (int, int) or None
        None if all are apart.
    """
    centers = np.array([complex(*vesicle.center) for vesicle in vesicles])
    reaches = np.array([np.abs(each - center).max() for each, center in zip(outlines, centers, strict=True)])
    for index, center in enumerate(centers[:-1]):
        near = np.abs(centers[index + 1 :] - center) < reaches[index + 1 :] + reaches[index]
        for other in (index + 1 + np.flatnonzero(near)).tolist():
            first, second = outlines[index], outlines[other]
            if _within(first, second).any() or _within(second, first).any():
                return index, other
    return None


def _within(points: ComplexArray, polygon: ComplexArray) -> NDArray[np.bool_]:
    """Return which points lie within a polygon: those around which it winds."""
    to_corners = polygon[None, :] - points[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        turns = np.angle(np.roll(to_corners, -1, axis=1) / to_corners).sum(axis=1) / (2 * np.pi)
    return np.asarray(np.abs(turns) > 0.5)
