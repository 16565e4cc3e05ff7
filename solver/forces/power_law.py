"""Compiled sums of the adhesion potential between points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled

Array = NDArray[np.float64]


class Potential(NamedTuple):
    """φ/H = (δ/r)^m − (m/n)(δ/r)^n, with δ = ``distance``."""

    distance: float
    m: int
    n: int


@compiled(inline="always")
def potential_row(
    x: float,
    y: float,
    sources: Array,
    potential: Potential,
    dx: Array,
    dy: Array,
    inverse: Array,
    high: Array,
    low: Array,
) -> None:
    """Write offsets from all sources, 1/r², (δ/r)^m and (δ/r)^n for the target (x, y).

    The exponents are known only at run time, so each multiplication is a loop of its own over the row.
    """
    distance, m, n = potential
    square = distance * distance
    for j in range(dx.size):
        dx[j] = x - sources[0, j]
        dy[j] = y - sources[1, j]
        inverse[j] = 1.0 / (dx[j] * dx[j] + dy[j] * dy[j])
        low[j] = 1.0
    for _ in range(n // 2):
        for j in range(dx.size):
            low[j] *= square * inverse[j]
    for j in range(dx.size):
        high[j] = low[j]
    for _ in range(m // 2 - n // 2):
        for j in range(dx.size):
            high[j] *= square * inverse[j]
    if n % 2 == 1:
        for j in range(dx.size):
            low[j] *= np.sqrt(square * inverse[j])
    if m % 2 == 1:
        for j in range(dx.size):
            high[j] *= np.sqrt(square * inverse[j])


@compiled
def adhesion_force(targets: Array, sources: Array, potential: Potential, scale: float, out: Array) -> None:
    """Write scale·Σ (x−y)/r² [(δ/r)^m − (δ/r)^n] over ``sources`` (2, s) to out (2, t) for each target."""
    dx, dy, inverse, high, low = np.empty((5, sources.shape[1]))
    for i in range(targets.shape[1]):
        potential_row(targets[0, i], targets[1, i], sources, potential, dx, dy, inverse, high, low)
        fx = 0.0
        fy = 0.0
        for j in range(sources.shape[1]):
            strength = inverse[j] * (high[j] - low[j])
            fx += dx[j] * strength
            fy += dy[j] * strength
        out[0, i] = scale * fx
        out[1, i] = scale * fy


@compiled
def adhesion_energy(targets: Array, sources: Array, potential: Potential) -> float:
    """Σ Σ φ/H over ``targets`` (2, t) and ``sources`` (2, s)."""
    dx, dy, inverse, high, low = np.empty((5, sources.shape[1]))
    ratio = potential.m / potential.n
    total = 0.0
    for i in range(targets.shape[1]):
        potential_row(targets[0, i], targets[1, i], sources, potential, dx, dy, inverse, high, low)
        for j in range(sources.shape[1]):
            total += high[j] - ratio * low[j]
    return total


@compiled
def adhesion_hessian(
    targets: Array, sources: Array, potential: Potential, scale: float, xx: Array, xy: Array, yy: Array
) -> None:
    """Fill the components (t, s) of the derivative of each pair's force by the target's position."""
    dx, dy, inverse, high, low = np.empty((5, sources.shape[1]))
    m, n = potential.m, potential.n
    for i in range(targets.shape[1]):
        potential_row(targets[0, i], targets[1, i], sources, potential, dx, dy, inverse, high, low)
        for j in range(sources.shape[1]):
            strength = scale * inverse[j] * (high[j] - low[j])
            radial = -scale * inverse[j] * inverse[j] * ((m + 2) * high[j] - (n + 2) * low[j])
            xx[i, j] = strength + radial * dx[j] * dx[j]
            xy[i, j] = radial * dx[j] * dy[j]
            yy[i, j] = strength + radial * dy[j] * dy[j]
