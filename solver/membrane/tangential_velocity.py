"""Points glide along each membrane so that their tangent angles change least.

A vesicle's membrane is the same everywhere, so its points need not follow the material.  With a speed c added
along the tangent, θ_t = n · u_s + c θ_s, and a membrane that treads around a steady shape becomes a steady
state, through which an integrator takes large steps.  Let κ̄ and κ̃ be the mean of the curvature κ = θ_s and
the rest, and w̄ and w̃ those of w = n · u_s.  Least squares over what varies along the membrane,
c = −⟨w̃, κ̃⟩/⟨κ̃, κ̃⟩, leaves a rigid turn alone, but says nothing about a circle, and jumps near one.  So it
fades there into c = −w̄/κ̄, with which the points stay while the circle turns:

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
    """The linear functional of n · u_s that is the gliding speed, (M, N), for curvatures (M, N)."""
    direction = np.empty_like(curvature)
    for vesicle in range(curvature.shape[0]):
        bend = curvature[vesicle]
        mean = bend.mean()
        varying = bend - mean
        weight = np.mean(varying * varying) * varying + _CIRCLE * mean**3
        direction[vesicle] = -weight / np.sum(weight * bend)
    return direction


@compiled
def tangential_speed(curvature: Array, rotation_rate: Array) -> Array:
    """Gliding speeds (M,) for curvatures and n · u_s, (M, N) each."""
    return np.sum(tangential_speed_weights(curvature) * rotation_rate, axis=1)


@compiled
def tangential_speed_by_curvature(curvature: Array, rotation_rate: Array) -> Array:
    """Derivative (M, N) of each vesicle's `tangential_speed` by its curvature, at fixed n · u_s."""
    derivative = np.empty_like(curvature)
    for vesicle in range(curvature.shape[0]):
        bend, turn = curvature[vesicle], rotation_rate[vesicle]
        mean, mean_turn = bend.mean(), turn.mean()
        varying = bend - mean
        square = np.mean(varying * varying)
        weight = square * varying + _CIRCLE * mean**3
        total = np.sum(weight * bend)
        speed = -np.sum(weight * turn) / total
        # Of ⟨w, q⟩ and of ⟨κ, q⟩.
        of_turn = 2 * np.mean(varying * turn) * varying + square * (turn - mean_turn)
        of_turn += 3 * _CIRCLE * mean**2 * mean_turn
        of_bend = 3 * square * varying + 3 * _CIRCLE * mean**3 + weight
        derivative[vesicle] = -(of_turn + speed * of_bend) / total
    return derivative


@compiled
def add_tangential_motion(curvature: Array, rotation_rate: Array, held: Array) -> None:
    """Turn n · u_s (M, N) into θ_t, in place, without the modes ``held`` (N, k)."""
    speed = tangential_speed(curvature, rotation_rate)
    for vesicle in range(rotation_rate.shape[0]):
        rotation_rate[vesicle] += speed[vesicle] * curvature[vesicle]
    rotation_rate -= np.dot(np.dot(rotation_rate, held), held.T)
