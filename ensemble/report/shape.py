"""How far apart two shapes are, whichever way their points are spread along them.

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

_SAMPLES = 16  # of the curve for each of its points, among which the search for the nearest begins
_NEWTON_STEPS = 8


def final_membranes(run: Run) -> Array:
    """Points of all membranes in a run's last frame, shape (vesicles, 2, points)."""
    lengths = np.array([vesicle.length for vesicle in run.scene.vesicles])
    return curve.positions(run.frames.tangent_angle[-1], run.frames.center[-1], lengths)


def shape_distance(points: Array, other: Array) -> Array:
    """Distance of each point to the closed curve through other points.

    Parameters
    ----------
    points : (2, N)
    other : (2, M)
        Points at equal steps of a parameter along a smooth closed curve, M even.

    Returns
    -------
    (N,)
        Exact to round-off where the curve is closer than its radius of curvature.
    """
    place = points[0] + 1j * points[1]
    coefficients = np.fft.fft(other[0] + 1j * other[1]) / other.shape[1]
    wavenumber = np.fft.fftfreq(other.shape[1], 1 / other.shape[1])
    wavenumber[other.shape[1] // 2] = 0  # the highest mode has no sign, and no derivative
    sampled = 2 * np.pi * np.arange(_SAMPLES * other.shape[1]) / (_SAMPLES * other.shape[1])
    nearest = np.argmin(np.abs(place[:, None] - _curve(coefficients, wavenumber, sampled)), axis=1)
    parameter = sampled[nearest]
    # The offset is shortest where it is normal to the curve.
    for _ in range(_NEWTON_STEPS):
        offset = _curve(coefficients, wavenumber, parameter) - place
        first = _curve(1j * wavenumber * coefficients, wavenumber, parameter)
        second = _curve(-(wavenumber**2) * coefficients, wavenumber, parameter)
        slope = np.real(first * first.conj() + offset * second.conj())
        parameter = parameter - np.real(offset * first.conj()) / slope
    return np.abs(_curve(coefficients, wavenumber, parameter) - place)


def _curve(
    coefficients: NDArray[np.complex128], wavenumber: Array, parameter: Array
) -> NDArray[np.complex128]:
    values: NDArray[np.complex128] = np.exp(1j * np.outer(parameter, wavenumber)) @ coefficients
    return values
