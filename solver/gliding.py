"""Points glide along each membrane so that their tangent angles change least.

A vesicle's membrane is the same everywhere, so its points need not follow the material.  With a speed c added
along the tangent, θ_t = n · u_s + c θ_s, and a membrane that treads around a steady shape becomes a steady
state, through which an integrator takes large steps.  The speed is a least-squares choice over the part of
θ_t that varies along the membrane (a rigid turn has none, and is left alone):

    c = −⟨w̃, κ̃⟩/⟨κ̃, κ̃⟩,

w̃ and κ̃ being n · u_s and the curvature, each without its mean.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.kernels import compiled

Array = NDArray[np.float64]


@compiled
def gliding_direction(curvature: Array) -> Array:
    """The linear functional of n · u_s that is the gliding speed, (M, N), for curvatures (M, N)."""
    direction = np.empty_like(curvature)
    for vesicle in range(curvature.shape[0]):
        variation = curvature[vesicle] - curvature[vesicle].mean()
        # On a circle gliding changes nothing, and the quotient of two round-off errors must not drive it.
        smallest = 1e-12 * np.sum(curvature[vesicle] ** 2)
        direction[vesicle] = -variation / (np.sum(variation**2) + smallest)
    return direction


@compiled
def gliding_speed(curvature: Array, turning: Array) -> Array:
    """Gliding speeds (M,) for curvatures and n · u_s, (M, N) each."""
    return np.sum(gliding_direction(curvature) * turning, axis=1)


@compiled
def glide(curvature: Array, turning: Array, held: Array) -> None:
    """Turn n · u_s (M, N) into θ_t, in place, without the modes ``held`` (N, k)."""
    speed = gliding_speed(curvature, turning)
    for vesicle in range(turning.shape[0]):
        turning[vesicle] += speed[vesicle] * curvature[vesicle]
    turning -= np.dot(np.dot(turning, held), held.T)
