"""The curve that a list of tangent angles describes: what it encloses, and whether it crosses itself.

With θ at N points equispaced in arclength, of a curve of the length 2π, and exp(iθ) = Σ c_k exp(ikα), the
points are Σ c_k/(ik) exp(ikα).  So the curve is closed if c_0 = 0, and 4π·area/length² = Σ |c_k|²/k.  The
mode k = N/2 has no sign and is left out, as in `solver.membrane.spectral`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_FEWEST_SEGMENTS = 256  # of the polygon that is searched for crossings
_CORRECTIONS, _ROUND_OFF = 20, 1e-14  # steps of Newton's method at most, and where it ends


def reduced_area_of(tangent_angle: Array) -> tuple[float, float]:
    """Return the reduced area of a curve, and how far it is from closing.

    Parameters
    ----------
    tangent_angle : (N,)
        Radians, at points equispaced in arclength.

    Returns
    -------
    reduced_area : float
        4π·area/length²; negative for a clockwise curve.
    gap : float
        Between its ends, over its length.
    """
    modes, k = modes_of(tangent_angle)
    enclosed = np.sum(np.abs(modes[k != 0]) ** 2 / k[k != 0])
    return float(enclosed), float(np.abs(modes[0]))


def points_of(tangent_angle: Array, count: int) -> ComplexArray:
    """Return points x + iy of a curve of the length 2π about the origin.

    Parameters
    ----------
    tangent_angle : (N,)
        Radians, at points equispaced in arclength.
    count : int
        At least N.

    Returns
    -------
    (count,)
        Equispaced in arclength.
    """
    modes, k = modes_of(tangent_angle)
    padded = np.zeros(count, dtype=np.complex128)
    padded[k.astype(np.int64)] = np.where(k == 0, 0.0, modes / np.where(k == 0, 1, 1j * k))
    return np.asarray(np.fft.ifft(padded) * count)


def closed_of_reduced_area(tangent_angle: Array, reduced_area: float) -> Array:
    """Return the closed membrane of exactly this reduced area that differs least from a given curve.

    Newton's method with the least changes of the tangent angles; `solver.membrane.restoring` has their
    gradients.

    Parameters
    ----------
    tangent_angle : (N,)
        Of a curve that nearly is such a membrane.
    reduced_area : float
        4π·area/length², in (0, 1].

    Returns
    -------
    (N,)
        Tangent angles; as near as Newton's method has come.
    """
    theta = tangent_angle
    for _ in range(_CORRECTIONS):
        tangents = np.exp(1j * theta)
        mean = tangents.mean()
        deviations = np.array([reduced_area_of(theta)[0] - reduced_area, mean.real, mean.imag])
        if np.abs(deviations).max() < _ROUND_OFF:
            break
        of_area = 2 * (tangents.conj() * points_of(theta, theta.size)).real
        gradients = np.stack([of_area, -tangents.imag, tangents.real])
        products = gradients @ gradients.T / theta.size
        theta = theta - np.linalg.lstsq(products, deviations)[0] @ gradients
    return theta


def crosses_itself(tangent_angle: Array) -> bool:
    """Return whether a closed curve crosses itself.

    Parameters
    ----------
    tangent_angle : (N,)
        Radians, at points equispaced in arclength.

    Returns
    -------
    bool
    """
    starts = points_of(tangent_angle, max(tangent_angle.size, _FEWEST_SEGMENTS))
    segments = np.roll(starts, -1) - starts
    middles, longest = starts + segments / 2, np.abs(segments).max()
    # Each segment with the one so many places ahead.  Those that cross have their middles within a length.
    for ahead in range(2, starts.size // 2 + 1):
        (near,) = np.nonzero(np.abs(np.roll(middles, -ahead) - middles) <= longest)
        other = (near + ahead) % starts.size
        if near.size and np.any(
            _on_both_sides(starts[near], segments[near], starts[other], segments[other])
            & _on_both_sides(starts[other], segments[other], starts[near], segments[near])
        ):
            return True
    return False


def _on_both_sides(
    start: ComplexArray, segment: ComplexArray, other: ComplexArray, its_segment: ComplexArray
) -> NDArray[np.bool_]:
    """Return whether the ends of other segments lie on different sides of the lines through segments."""
    first = (segment.conj() * (other - start)).imag > 0
    second = (segment.conj() * (other + its_segment - start)).imag > 0
    return np.asarray(first != second)


def modes_of(tangent_angle: Array) -> tuple[ComplexArray, Array]:
    """Return the Fourier coefficients of the unit tangents exp(iθ), and their wavenumbers.

    Parameters
    ----------
    tangent_angle : (N,)

    Returns
    -------
    coefficients : complex (N,)
    wavenumbers : (N,)
    """
    size = tangent_angle.size
    wavenumbers = np.fft.fftfreq(size, 1 / size).astype(np.float64)
    wavenumbers[size // 2] = 0
    return np.fft.fft(np.exp(1j * tangent_angle)) / size, wavenumbers
