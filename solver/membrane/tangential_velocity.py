"""The tangential velocity with which points move along each membrane so that tangent angles change least.

A vesicle's membrane is the same everywhere, so its points need not follow the material.  With a speed c added
along the tangent, θ_t = n · u_s + c θ_s, and a membrane that treads around a steady shape becomes a steady
state, through which an integrator takes large steps.  Let κ̄ be the mean of the curvature κ = θ_s and κ̃ the
rest, and likewise w̄ and w̃ for w = n · u_s.  Least squares over what varies along the membrane gives
c = −⟨w̃, κ̃⟩/⟨κ̃, κ̃⟩.  This leaves a rigid rotation alone, but on a circle it is undefined, and near one it
jumps.  There it fades into c = −w̄/κ̄, with which the points stay while the circle turns (README, S7):

    c = −⟨w, q⟩/⟨κ, q⟩,    q = ⟨κ̃, κ̃⟩ κ̃ + η⁴ κ̄³.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled

Array = NDArray[np.float64]

_CIRCLE = 1e-3**4  # η⁴: a vesicle whose curvature varies by less than a thousandth is taken for a circle


@compiled
def tangential_speed_weights(curvature: Array) -> Array:
    """Return the weights of n · u_s whose sum over a membrane is its tangential speed.

    Parameters
    ----------
    curvature : (M, N)

    Returns
    -------
    (M, N)
    """
    weights = np.empty_like(curvature)
    for vesicle in range(curvature.shape[0]):
        kappa = curvature[vesicle]
        mean = kappa.mean()
        varying = kappa - mean
        q = np.mean(varying * varying) * varying + _CIRCLE * mean**3
        weights[vesicle] = -q / np.sum(q * kappa)
    return weights


@compiled
def tangential_speed(curvature: Array, rotation_rate: Array) -> Array:
    """Return the speed of the points along each membrane.

    Parameters
    ----------
    curvature : (M, N)
    rotation_rate : (M, N)
        How fast the material turns, n · u_s.

    Returns
    -------
    (M,)
    """
    return np.sum(tangential_speed_weights(curvature) * rotation_rate, axis=1)


@compiled
def tangential_speed_by_curvature(curvature: Array, rotation_rate: Array) -> Array:
    """Return the derivative of each vesicle's `tangential_speed` by its curvature, at fixed n · u_s.

    Parameters
    ----------
    curvature, rotation_rate : (M, N)
        As for `tangential_speed`.

    Returns
    -------
    (M, N)
    """
    derivative = np.empty_like(curvature)
    for vesicle in range(curvature.shape[0]):
        kappa, w = curvature[vesicle], rotation_rate[vesicle]
        mean, mean_w = kappa.mean(), w.mean()
        varying = kappa - mean
        square = np.mean(varying * varying)
        q = square * varying + _CIRCLE * mean**3
        total = np.sum(q * kappa)
        speed = -np.sum(q * w) / total
        # Derivatives of N⟨w, q⟩ and N⟨κ, q⟩ by the curvature.
        numerator = 2 * np.mean(varying * w) * varying + square * (w - mean_w)
        numerator += 3 * _CIRCLE * mean**2 * mean_w
        denominator = 3 * square * varying + 3 * _CIRCLE * mean**3 + q
        derivative[vesicle] = -(numerator + speed * denominator) / total
    return derivative


@compiled
def add_tangential_motion(curvature: Array, rotation_rate: Array, held: Array) -> None:
    """Make θ_t of n · u_s, in place: add c·θ_s and take off modes that stay as they are.

    Parameters
    ----------
    curvature : (M, N)
    rotation_rate : (M, N)
        On entry n · u_s, on return θ_t.
    held : (N, k)
        Orthonormal basis of the modes that stay.
    """
    speed = tangential_speed(curvature, rotation_rate)
    for vesicle in range(rotation_rate.shape[0]):
        rotation_rate[vesicle] += speed[vesicle] * curvature[vesicle]
    rotation_rate -= np.dot(np.dot(rotation_rate, held), held.T)
