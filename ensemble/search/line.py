"""The straight line through the points of a boundary."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from pydantic import BaseModel

from ensemble.search.boundary import Boundary
from ensemble.search.critical_value import SearchStatus

FEWEST_POINTS = 3  # two points lie on a line whatever the physics
LARGEST_RESIDUAL = 0.02  # of the range of the critical values; beyond, points lie visibly off the line


class Line(BaseModel):
    """The straight line through the converged points: critical value = intercept + slope × parameter.

    Attributes
    ----------
    intercept : float
        Critical value where the parameter is 0.
    slope : float
        Of the critical value against the parameter.
    """

    intercept: float
    slope: float


def line_through(boundary: Boundary) -> Line | None:
    """Fit a line to the converged points of a boundary by least squares.

    Parameters
    ----------
    boundary : Boundary
        The boundary.

    Returns
    -------
    Line or None
        None if several parameters are swept, fewer than three points have converged, or one of them lies off
        the line by more than 2 % of the difference between the largest and the smallest critical value.
    """
    if len(boundary.swept) > 1:
        return None
    (swept,) = boundary.swept
    points = [
        (point.parameters[swept], point.critical_value)
        for point in boundary.points
        if point.status == SearchStatus.CONVERGED and point.critical_value is not None
    ]
    if len(points) < FEWEST_POINTS:
        return None
    parameters, critical = np.array(points).T
    fit = Polynomial.fit(parameters, critical, deg=1)
    if np.abs(fit(parameters) - critical).max() > LARGEST_RESIDUAL * np.ptp(critical):
        return None
    intercept, slope = fit.convert().coef
    return Line(intercept=float(intercept), slope=float(slope))
