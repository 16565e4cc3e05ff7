"""Starting shapes: ellipses of exact reduced area and length, sampled equally in arclength."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc

from solver import curve

Array = NDArray[np.float64]


def semi_axes(reduced_area: float, length: float) -> tuple[float, float]:
    """Semi-axes a ≥ b of the ellipse with this perimeter and reduced area 4π·area/length².

    The perimeter is 4aE(m) with m = 1 − b²/a² (complete elliptic integral of the second kind), so the
    reduced area is π²√(1−m)/(4E(m)²), which falls from 1 to 0 as the aspect ratio falls.
    """
    if reduced_area == 1.0:
        radius = length / (2 * np.pi)
        return radius, radius

    def excess(aspect: float) -> float:
        return float(np.pi**2 * aspect / (4 * ellipe(1 - aspect**2) ** 2) - reduced_area)

    aspect = brentq(excess, 1e-9, 1.0, xtol=1e-16, rtol=1e-15)
    major = length / (4 * ellipe(1 - aspect**2))
    return major, major * aspect


def ellipse_tangent_angle(reduced_area: float, length: float, angle: float, points: int) -> Array:
    """Tangent angles at ``points`` positions equispaced in arclength, (points,).

    The membrane through them has the reduced area to round-off, even where the points do not resolve the
    tips: the deviation from a circle's angles is scaled for that.

    Parameters
    ----------
    angle : float
        Direction of the long axis against x, radians.  The first point is its tip.
    """
    circle = np.pi / 2 + 2 * np.pi * np.arange(points) / points
    deviation = _sampled_ellipse(reduced_area, length, points) - circle

    def excess(scale: float) -> float:
        theta = circle + scale * deviation
        area = curve.area(curve.positions(theta, np.zeros(2), 2 * np.pi), curve.tangents(theta), 2 * np.pi)
        return float(area / np.pi - reduced_area)

    scale = brentq(excess, 0.5, 1.5, xtol=1e-15, rtol=1e-15) if np.any(deviation) else 1.0
    return angle + circle + scale * deviation


def _sampled_ellipse(reduced_area: float, length: float, points: int) -> Array:
    """Tangent angles of the ellipse along x."""
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
    turned = np.arctan2(minor * np.cos(alpha), -major * np.sin(alpha))
    return np.unwrap(turned)
