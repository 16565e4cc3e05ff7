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
from solver.membrane.products import project_out

Array = NDArray[np.float64]

_CIRCLE = 1e-3**4  # η⁴: a vesicle whose curvature varies by less than a thousandth is taken for a circle


@compiled
def tangential_speed_weights(curvature: Array, weights: Array) -> None:
    """Write the weights of n · u_s whose sum over a membrane is its tangential speed.

    Parameters
    ----------
    curvature : (N,)
    weights : (N,)
        Written to.
    """
    mean = curvature.mean()
    square = 0.0
    for j in range(weights.size):
        square += (curvature[j] - mean) ** 2
    square /= weights.size
    total = 0.0
    for j in range(weights.size):
        weights[j] = square * (curvature[j] - mean) + _CIRCLE * mean**3
        total += weights[j] * curvature[j]
    for j in range(weights.size):
        weights[j] /= -total


@compiled
def tangential_speed_by_curvature(curvature: Array, rotation_rate: Array, derivative: Array) -> float:
    """Write the derivative of a membrane's tangential speed by its curvature, at fixed n · u_s.

    Parameters
    ----------
    curvature, rotation_rate : (N,)
        The latter is how fast the material turns, n · u_s.
    derivative : (N,)
        Written to.

    Returns
    -------
    float
        The speed.
    """
    size = curvature.size
    mean, mean_w = curvature.mean(), rotation_rate.mean()
    square = product = 0.0
    for j in range(size):
        square += (curvature[j] - mean) ** 2
        product += (curvature[j] - mean) * rotation_rate[j]
    square, product = square / size, product / size
    shift = _CIRCLE * mean**3
    total = speed = 0.0
    for j in range(size):
        q = square * (curvature[j] - mean) + shift
        total += q * curvature[j]
        speed -= q * rotation_rate[j]
    speed /= total
    for j in range(size):
        varying = curvature[j] - mean
        # Derivatives of N⟨w, q⟩ and N⟨κ, q⟩ by the curvature.
        numerator = 2 * product * varying + square * (rotation_rate[j] - mean_w)
        numerator += 3 * _CIRCLE * mean**2 * mean_w
        denominator = 4 * square * varying + 4 * shift
        derivative[j] = -(numerator + speed * denominator) / total
    return speed


@compiled
def add_tangential_motion(curvature: Array, rotation_rate: Array, held: Array) -> None:
    """Make θ_t of n · u_s on a membrane, in place: add c·θ_s and take off modes that stay as they are.

    Parameters
    ----------
    curvature : (N,)
    rotation_rate : (N,)
        On entry n · u_s, on return θ_t.
    held : (N, k)
        Orthonormal basis of the modes that stay.
    """
    weights = np.empty(curvature.size)
    tangential_speed_weights(curvature, weights)
    speed = 0.0
    for j in range(weights.size):
        speed += weights[j] * rotation_rate[j]
    for j in range(weights.size):
        rotation_rate[j] += speed * curvature[j]
    project_out(held, rotation_rate)
