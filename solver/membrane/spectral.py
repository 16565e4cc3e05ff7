"""Trigonometric interpolation on equispaced points, as dense matrices.

For the few hundred points a membrane needs, a matrix product costs less than a fast Fourier transform and
joins directly into the Jacobian.  All matrices are real and circulant (or band-limited rectangular); they
depend on the number of points alone and are made once.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def _frozen(matrix: Array) -> Array:
    matrix = np.ascontiguousarray(matrix)
    matrix.setflags(write=False)
    return matrix


def _convolution(symbol: NDArray[np.complexfloating]) -> Array:
    """The circulant matrix whose eigenvalue on exp(ikα) is ``symbol[k]``, in FFT order."""
    from scipy.linalg import circulant  # for the reason that `solver.membrane.shapes` gives

    return _frozen(circulant(np.fft.ifft(symbol).real).astype(np.float64))


def wavenumbers(points: int) -> Array:
    """Integer wavenumbers in FFT order; the highest one (points/2) is set to zero.

    On an even number of points that mode has no sign, so an odd derivative of it vanishes.
    """
    k = np.fft.fftfreq(points, 1 / points).astype(np.float64)
    k[points // 2] = 0
    return k


@cache
def differentiation(points: int, order: int = 1) -> Array:
    """Matrix of d^order/dα^order at α_j = 2πj/points, shape (points, points)."""
    return _convolution((1j * wavenumbers(points)) ** order)


@cache
def integration(points: int) -> Array:
    """Matrix of the zero-mean periodic antiderivative in α of a function's zero-mean part."""
    k = wavenumbers(points)
    symbol = np.zeros(points, dtype=complex)
    symbol[k != 0] = 1 / (1j * k[k != 0])
    return _convolution(symbol)


@cache
def interpolation(points: int, factor: int) -> Array:
    """Trigonometric interpolation to ``factor`` times as many points, shape (factor·points, points)."""
    spectrum = np.fft.fft(np.eye(points), axis=0)
    fine = np.zeros((factor * points, points), dtype=complex)
    half = points // 2
    fine[:half] = spectrum[:half]
    fine[-half + 1 :] = spectrum[half + 1 :]
    fine[half] += 0.5 * spectrum[half]
    fine[-half] += 0.5 * spectrum[half]
    return _frozen(factor * np.fft.ifft(fine, axis=0).real)


@cache
def interpolations(points: int, largest_factor: int) -> Array:
    """The matrices of `interpolation` for the factors 2, 4, … up to the largest, one below the other."""
    factors = [2**power for power in range(1, largest_factor.bit_length())]
    return _frozen(np.concatenate([np.empty((0, points)), *(interpolation(points, f) for f in factors)]))


def resampled(values: Array, points: int) -> Array:
    """Trigonometric interpolation of values (..., N) to ``points`` ≥ N points, (..., points), both even."""
    given = values.shape[-1]
    if points == given:
        return values
    spectrum = np.fft.rfft(values, axis=-1)
    spectrum[..., -1] *= 0.5  # the highest mode stands for the two that it cannot tell apart
    return np.asarray(np.fft.irfft(spectrum, points, axis=-1)) * (points / given)


@cache
def logarithm_weights(points: int) -> Array:
    """Circulant quadrature matrix W of the logarithm: Σ_j W_ij f_j = −½∫ log(4 sin²((α_i−β)/2)) f(β) dβ.

    Exact for trigonometric polynomials (Kress, Linear Integral Equations, section 12.3): the operator maps
    exp(ikα) to π/|k| exp(ikα) and constants to zero.
    """
    k = np.abs(np.fft.fftfreq(points, 1 / points))
    symbol = np.zeros(points, dtype=complex)
    symbol[1:] = np.pi / k[1:]
    return _convolution(symbol)


@cache
def highest_modes(points: int) -> Array:
    """Orthonormal basis of the modes with wavenumbers points/2 − 1 and points/2, shape (points, 3)."""
    alpha = 2 * np.pi * np.arange(points) / points
    below = points // 2 - 1
    basis = np.stack([np.cos(below * alpha), np.sin(below * alpha), np.cos((below + 1) * alpha)], axis=1)
    return _frozen(basis / np.linalg.norm(basis, axis=0))


def tail(values: Array) -> Array:
    """Root of the summed squares of the last third of the spectrum, along the last axis."""
    spectrum = np.fft.rfft(values, axis=-1) / values.shape[-1]
    start = (2 * (spectrum.shape[-1] - 1)) // 3
    return 2 * np.sqrt(np.sum(np.abs(spectrum[..., start:]) ** 2, axis=-1))
