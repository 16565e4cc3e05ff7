"""Points glide along each membrane so that their tangent angles change least.

A vesicle's membrane is the same everywhere, so its points need not follow the material.  With a speed c added
along the tangent, θ_t = n · u_s + c θ_s, and a membrane that treads around a steady shape becomes a steady
state, through which an integrator takes large steps.  The speed is a least-squares choice over the part of
θ_t that varies along the membrane (a rigid turn has none, and is left alone):

    c = −(⟨w̃, κ̃⟩ + ε w̄ κ̄) / (⟨κ̃, κ̃⟩ + ε κ̄²),

w̄ and w̃ being the mean of n · u_s and the rest, κ̄ and κ̃ those of the curvature.  A circle has no κ̃: there the
tiny ε lets the points stay while it turns.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled

Array = NDArray[np.float64]

_CIRCLE_WEIGHT = 1e-12


@compiled
def gliding_direction(curvature: Array) -> Array:
    """The linear functional of n · u_s that is the gliding speed, (M, N), for curvatures (M, N)."""
    direction = np.empty_like(curvature)
    for vesicle in range(curvature.shape[0]):
        weighted = curvature[vesicle] - (1 - _CIRCLE_WEIGHT) * curvature[vesicle].mean()
        direction[vesicle] = -weighted / np.sum(weighted * curvature[vesicle])
    return direction


@compiled
def gliding_speed(curvature: Array, turning: Array) -> Array:
    """Gliding speeds (M,) for curvatures and n · u_s, (M, N) each."""
    return np.sum(gliding_direction(curvature) * turning, axis=1)


@compiled
def gliding_speed_by_curvature(curvature: Array, turning: Array) -> Array:
    """Derivative (M, N) of each vesicle's `gliding_speed` by its curvature, at fixed n · u_s."""
    derivative = np.empty_like(curvature)
    for vesicle in range(curvature.shape[0]):
        bend, turn = curvature[vesicle], turning[vesicle]
        weighted = bend - (1 - _CIRCLE_WEIGHT) * bend.mean()
        weighted_turn = turn - (1 - _CIRCLE_WEIGHT) * turn.mean()
        square = np.sum(weighted * bend)
        speed = -np.sum(weighted * turn) / square
        derivative[vesicle] = -(weighted_turn + 2 * speed * weighted) / square
    return derivative


@compiled
def glide(curvature: Array, turning: Array, held: Array) -> None:
    """Turn n · u_s (M, N) into θ_t, in place, without the modes ``held`` (N, k)."""
    speed = gliding_speed(curvature, turning)
    for vesicle in range(turning.shape[0]):
        turning[vesicle] += speed[vesicle] * curvature[vesicle]
    turning -= np.dot(np.dot(turning, held), held.T)
