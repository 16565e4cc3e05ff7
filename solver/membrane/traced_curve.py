"""A membrane from points along its outline, as a picture or another program gives them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.membrane import curve
from solver.membrane.resampling import resampled_angle
from solver.scene.tangent_angles import closed_of_reduced_area, crosses_itself, reduced_area_of

Array = NDArray[np.float64]

FEWEST_POINTS = 8
_FEWEST_ANGLES, _MOST_ANGLES = 32, 512
_LARGEST = 1e100  # of which neither the square nor its inverse is out of range
_NEAREST = 1e-12  # over the extent; nearer points have no direction from one to the next but round-off
_FINE = 8192  # arclengths at which the spline is sampled
_DRAWN = 1024  # points of the curve among which the nearest ones, and crossings, are looked for


@dataclass(frozen=True)
class TracedCurve:
    """A closed curve through points.

    Attributes
    ----------
    tangent_angle : (N,)
        Radians, counterclockwise at points equispaced in arclength.
    length : float
    reduced_area : float
        4π·area/length².
    center : (2,)
        Mean of the curve.
    distance : float
        The largest of a given point from the curve.
    """

    tangent_angle: Array
    length: float
    reduced_area: float
    center: Array
    distance: float


def traced_curve(points: Array) -> TracedCurve:
    """Return the closed curve through points: a cubic spline without waves that they cannot tell apart.

    Parameters
    ----------
    points : (n, 2)
        Along the curve, either way round, at any distances; the last one may repeat the first.

    Returns
    -------
    TracedCurve

    Raises
    ------
    ValueError
        If they are too few, or no simple closed curve goes through them.
    """
    from scipy.interpolate import CubicSpline  # for the reason that `solver.membrane.shapes` gives

    points = _counterclockwise(points)
    closed = np.concatenate([points, points[:1]])
    chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    spline = CubicSpline(chord, closed, bc_type="periodic")
    parameter = np.linspace(0, chord[-1], _FINE + 1)
    speed = np.hypot(*spline(parameter, 1).T)
    arclength = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2)]) * chord[-1] / _FINE
    length = float(arclength[-1])
    equispaced = np.interp(length * np.arange(_FINE) / _FINE, arclength, parameter)
    tangents = spline(equispaced, 1)
    fine = np.unwrap(np.arctan2(tangents[:, 1], tangents[:, 0]))
    angles = int(np.clip(2 * (len(points) // 2), _FEWEST_ANGLES, _MOST_ANGLES))
    shape = resampled_angle(fine, angles)
    enclosed, gap = reduced_area_of(shape)
    if not 0 < enclosed <= 1 + 1e-6 or gap > 0.01:
        raise ValueError("the points are not in order along a simple closed curve")
    reduced_area = min(enclosed, 1.0)
    shape = closed_of_reduced_area(shape, reduced_area)
    if crosses_itself(resampled_angle(shape, _DRAWN)):
        raise ValueError("the curve through the points crosses itself")
    center = spline(equispaced).mean(axis=0)
    return TracedCurve(shape, length, reduced_area, center, _largest_distance(points, shape, center, length))


def _largest_distance(points: Array, shape: Array, center: Array, length: float) -> float:
    """Return how far points are from a curve at most, along its normals."""
    angles = resampled_angle(shape, _DRAWN)
    drawn = curve.positions(angles, center, length).T
    nearest = np.array([np.hypot(*(drawn - point).T).argmin() for point in points])
    along, offsets = angles[nearest], points - drawn[nearest]
    return float(np.abs(offsets[:, 1] * np.cos(along) - offsets[:, 0] * np.sin(along)).max())


def _counterclockwise(points: Array) -> Array:
    """Check points, and return them without a repetition at the end, counterclockwise."""
    if points.ndim != 2 or points.shape[1] != 2 or not np.all(np.isfinite(points)):
        raise ValueError(f"points must be finite numbers in two columns, x and y, got shape {points.shape}")
    if len(points) and np.array_equal(points[0], points[-1]):
        points = points[:-1]
    if len(points) < FEWEST_POINTS:
        raise ValueError(f"at least {FEWEST_POINTS} different points are needed, got {len(points)}")
    following = np.roll(points, -1, axis=0)
    if np.abs(points).max() > _LARGEST or np.ptp(points, axis=0).max() < 1 / _LARGEST:
        raise ValueError(
            f"points must lie within {_LARGEST:g} of the origin, and extend over {1 / _LARGEST:g} at least"
        )
    if np.hypot(*(following - points).T).min() <= _NEAREST * np.ptp(points, axis=0).max():
        raise ValueError(f"neighboring points must differ, by {_NEAREST:g} of the extent of all at least")
    area = np.sum(points[:, 0] * following[:, 1] - points[:, 1] * following[:, 0]) / 2
    return points if area > 0 else points[::-1]
