"""Distance between two shapes, however their points are spread along them.

Points move along a membrane by a choice that has no physics in it (`solver.membrane.tangential_velocity`),
and it depends on step size and resolution. Two runs that agree on every membrane may therefore disagree on
every point, so runs are compared as shapes: each membrane is a closed curve, interpolated trigonometrically
through its points, and the error at a point is its distance to the curve of the other run.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.analysis.run import Run
from solver.membrane import curve

Array = NDArray[np.float64]

_SAMPLES = 16  # of the curve for each of its points; the search for the nearest point begins at one of them
_NEWTON_STEPS = 8


def final_membranes(run: Run) -> Array:
    """Return the points of all membranes in the last frame of a run.

    Parameters
    ----------
    run : Run
        A run with at least one frame.

    Returns
    -------
    (vesicles, 2, points)
        Positions, in the unit of length of the scene.
    """
    lengths = np.array([vesicle.length for vesicle in run.scene.vesicles])
    return curve.positions(run.frames.tangent_angle[-1], run.frames.center[-1], lengths)


def shape_distance(points: Array, other: Array) -> Array:
    """Return the distance of each point from the closed curve through other points.

    The curve is the trigonometric interpolant.  The nearest of many samples on it is the start of Newton's
    method for the point at which the offset is normal to the curve.

    Parameters
    ----------
    points : (2, N)
        The points.
    other : (2, M)
        Points at equal steps of a parameter along a smooth closed curve, M even.

    Returns
    -------
    (N,)
        Distances, exact to round-off where the curve is closer than its radius of curvature.
    """
    targets = points[0] + 1j * points[1]
    coefficients = np.fft.fft(other[0] + 1j * other[1]) / other.shape[1]
    wavenumber = np.fft.fftfreq(other.shape[1], 1 / other.shape[1])
    wavenumber[other.shape[1] // 2] = 0  # the highest mode has no sign, and no derivative
    sampled = 2 * np.pi * np.arange(_SAMPLES * other.shape[1]) / (_SAMPLES * other.shape[1])
    nearest = np.argmin(np.abs(targets[:, None] - _interpolant(coefficients, wavenumber, sampled)), axis=1)
    parameter = sampled[nearest]
    # Newton's method for: the offset is normal to the curve.
    for _ in range(_NEWTON_STEPS):
        offset = _interpolant(coefficients, wavenumber, parameter) - targets
        first = _interpolant(1j * wavenumber * coefficients, wavenumber, parameter)
        second = _interpolant(-(wavenumber**2) * coefficients, wavenumber, parameter)
        slope = np.real(first * first.conj() + offset * second.conj())
        parameter = parameter - np.real(offset * first.conj()) / slope
    return np.abs(_interpolant(coefficients, wavenumber, parameter) - targets)


def _interpolant(
    coefficients: NDArray[np.complex128], wavenumber: Array, parameter: Array
) -> NDArray[np.complex128]:
    values: NDArray[np.complex128] = np.exp(1j * np.outer(parameter, wavenumber)) @ coefficients
    return values
