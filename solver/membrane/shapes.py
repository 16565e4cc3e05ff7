"""Starting shapes of exact reduced area and length, sampled equally in arclength.

SciPy is imported by the functions that need it.  To import it takes longer than everything else that reads a
scene, and a process that only hands scenes on has no shape to compute.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.membrane import curve
from solver.membrane.spectral import equispaced_angles
from solver.roots import root
from solver.scene.ellipses import semi_axes

Array = NDArray[np.float64]


def of_reduced_area(tangent_angle: Array, reduced_area: float) -> Array:
    """Return a membrane like the given one that has exactly this reduced area.

    The deviation from a circle is scaled.  For an ellipse that the points resolve this changes only
    round-off.  Where they do not resolve its tips, the curve through them has not the area of the ellipse.

    Parameters
    ----------
    tangent_angle : (N,)
    reduced_area : float
        4π·area/length², in (0, 1].

    Returns
    -------
    (N,)
        Tangent angles.
    """
    circle = equispaced_angles(tangent_angle.size)
    circle = circle + np.mean(tangent_angle - circle)
    deviation = tangent_angle - circle

    def excess(scale: float) -> float:
        theta = circle + scale * deviation
        area = curve.area(curve.positions(theta, np.zeros(2), 2 * np.pi), curve.tangents(theta), 2 * np.pi)
        return float(area / np.pi - reduced_area)

    if np.max(np.abs(deviation)) < 1e-12:
        return tangent_angle
    return np.asarray(circle + root(excess, 0.5, 1.5, 1e-15) * deviation)


def ellipse_tangent_angle(reduced_area: float, length: float, angle: float, points: int) -> Array:
    """Return the tangent angles of an ellipse at points equispaced in arclength.

    Parameters
    ----------
    reduced_area : float
        4π·area/length², in (0, 1].
    length : float
        Perimeter.
    angle : float
        Direction of the long axis against x, radians.  The first point is its tip.
    points : int

    Returns
    -------
    (points,)
        Radians, increasing without jumps.
    """
    from scipy.special import ellipe, ellipeinc

    major, minor = semi_axes(reduced_area, length)
    parameter = 1 - (minor / major) ** 2
    arclength = length * np.arange(points) / points
    # With φ counted from the end of the minor axis, arclength is a·E(φ|m): φ = α − π/2.
    offset = major * ellipe(parameter)  # from the minor axis to the tip
    phi = arclength / length * 2 * np.pi - np.pi / 2
    for _ in range(50):
        error = major * ellipeinc(phi, parameter) + offset - arclength
        step = error / (major * np.sqrt(1 - parameter * np.sin(phi) ** 2))
        phi -= step
        if np.max(np.abs(step)) < 1e-15:
            break
    alpha = phi + np.pi / 2
    # The tangent (−a sin α, b cos α), its angle continued beyond ±π.
    return angle + np.unwrap(np.arctan2(minor * np.cos(alpha), -major * np.sin(alpha)))
