"""What a list of tangent angles encloses.

With θ at N points equispaced in arclength, of a curve of the length 2π, and exp(iθ) = Σ c_k exp(ikα), the
points are Σ c_k/(ik) exp(ikα).  So the curve is closed if c_0 = 0, and 4π·area/length² = Σ |c_k|²/k.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


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
    return np.fft.fft(np.exp(1j * tangent_angle)) / size, wavenumbers
