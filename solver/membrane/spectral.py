"""Trigonometric interpolation on equispaced points, as dense matrices.

For the few hundred points that a membrane needs, a matrix product costs less than a fast Fourier transform,
and the matrix enters the Jacobian directly.  All matrices are real and circulant, or rectangular for
interpolation.  They depend on the number of points alone and are made once.
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
    """Return the circulant matrix whose eigenvalue on exp(ikα) is ``symbol[k]``, in FFT order."""
    from scipy.linalg import circulant  # for the reason that `solver.membrane.shapes` gives

    return _frozen(circulant(np.fft.ifft(symbol).real).astype(np.float64))


def wavenumbers(points: int) -> Array:
    """Return the integer wavenumbers in FFT order, the highest one (points/2) set to zero.

    On an even number of points that mode has no sign, so an odd derivative of it vanishes.

    Parameters
    ----------
    points : int
        Even.

    Returns
    -------
    (points,)
    """
    k = np.fft.fftfreq(points, 1 / points).astype(np.float64)
    k[points // 2] = 0
    return k


@cache
def equispaced_angles(points: int) -> Array:
    """Return α_j = 2πj/points, the tangent angles of a circle.

    Parameters
    ----------
    points : int

    Returns
    -------
    (points,)
        Not to be written to.
    """
    return _frozen(2 * np.pi * np.arange(points) / points)


@cache
def differentiation(points: int, order: int = 1) -> Array:
    """Return the matrix of d^order/dα^order at α_j = 2πj/points.

    Parameters
    ----------
    points, order : int

    Returns
    -------
    (points, points)
        Not to be written to.
    """
    return _convolution((1j * wavenumbers(points)) ** order)


@cache
def integration(points: int) -> Array:
    """Return the matrix of the periodic antiderivative of mean zero, in α, of a function's part of mean zero.

    Parameters
    ----------
    points : int

    Returns
    -------
    (points, points)
        Not to be written to.
    """
    k = wavenumbers(points)
    symbol = np.zeros(points, dtype=complex)
    symbol[k != 0] = 1 / (1j * k[k != 0])
    return _convolution(symbol)


@cache
def interpolation(points: int, factor: int) -> Array:
    """Return the matrix of trigonometric interpolation to ``factor`` times as many points.

    Parameters
    ----------
    points, factor : int

    Returns
    -------
    (factor·points, points)
        Not to be written to.
    """
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
    """Return the matrices of `interpolation` for the factors 2, 4, … up to the largest, one below the other.

    Parameters
    ----------
    points : int
    largest_factor : int
        A power of two; 1 leaves an empty matrix.

    Returns
    -------
    ((2 + 4 + … + largest_factor)·points, points)
        Not to be written to.
    """
    factors = [2**power for power in range(1, largest_factor.bit_length())]
    return _frozen(np.concatenate([np.empty((0, points)), *(interpolation(points, f) for f in factors)]))


def resampled(values: Array, points: int) -> Array:
    """Interpolate periodic values trigonometrically to more points, or to fewer without the shortest waves.

    Parameters
    ----------
    values : (..., N)
        N even.
    points : int
        Even.

    Returns
    -------
    (..., points)
    """
    given = values.shape[-1]
    if points == given:
        return values
    spectrum = np.fft.rfft(values, axis=-1)
    if points > given:
        spectrum[..., -1] *= 0.5  # the highest mode stands for the two that it cannot tell apart
    else:
        spectrum[..., points // 2 :] = 0
    return np.asarray(np.fft.irfft(spectrum, points, axis=-1)) * (points / given)


@cache
def logarithm_weights(points: int) -> Array:
    """Return the quadrature matrix W of the logarithm, Σ_j W_ij f_j = −½∫ log(4 sin²((α_i−β)/2)) f(β) dβ.

    It is exact for trigonometric polynomials (Kress 2014, section 12.3): the operator maps exp(ikα) to
    π/|k| exp(ikα) and constants to zero.

    Parameters
    ----------
    points : int

    Returns
    -------
    (points, points)
        Circulant; not to be written to.
    """
    k = np.abs(np.fft.fftfreq(points, 1 / points))
    symbol = np.zeros(points, dtype=complex)
    symbol[1:] = np.pi / k[1:]
    return _convolution(symbol)


@cache
def highest_modes(points: int) -> Array:
    """Return an orthonormal basis of the modes with wavenumbers points/2 − 1 and points/2.

    Parameters
    ----------
    points : int

    Returns
    -------
    (points, 3)
        Not to be written to.
    """
    alpha = equispaced_angles(points)
    below = points // 2 - 1
    basis = np.stack([np.cos(below * alpha), np.sin(below * alpha), np.cos((below + 1) * alpha)], axis=1)
    return _frozen(basis / np.linalg.norm(basis, axis=0))


def tail(values: Array) -> Array:
    """Return the amplitude of the last third of the spectrum, the root of its summed squares.

    Parameters
    ----------
    values : (..., N)

    Returns
    -------
    (...)
    """
    return np.asarray(2 * np.linalg.norm(values @ _last_third(values.shape[-1]), axis=-1))


@cache
def _last_third(points: int) -> Array:
    """Return what maps values to real and imaginary parts of the last third of their spectrum, (N, ·)."""
    half = points // 2
    modes = np.arange(2 * half // 3, half + 1)
    angles = np.outer(equispaced_angles(points), modes)
    return _frozen(np.concatenate([np.cos(angles), np.sin(angles)], axis=1) / points)
