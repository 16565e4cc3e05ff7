"""Compiled sums of the adhesion potential over pairs of membrane points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.refinement import Refinement, interpolation_to, refined_points

Array = NDArray[np.float64]


@compiled(inline="always")
def potential_row(
    x: float,
    y: float,
    sources: Array,
    square: float,
    m: int,
    n: int,
    dx: Array,
    dy: Array,
    inverse: Array,
    high: Array,
    low: Array,
) -> None:
    """Write offsets from all sources, 1/r², (δ/r)^m and (δ/r)^n for the target (x, y); δ² = ``square``.

    The exponents are known only at run time, so each multiplication is a loop of its own over the row.
    """
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
def adhesion_force(
    targets: Array, sources: Array, distance: float, m: int, n: int, scale: float, out: Array
) -> None:
    """Write scale·Σ (x−y)/r² [(δ/r)^m − (δ/r)^n] over ``sources`` (2, s) to out (2, t) for each target."""
    dx, dy, inverse, high, low = np.empty((5, sources.shape[1]))
    for i in range(targets.shape[1]):
        square = distance * distance
        potential_row(targets[0, i], targets[1, i], sources, square, m, n, dx, dy, inverse, high, low)
        fx = 0.0
        fy = 0.0
        for j in range(sources.shape[1]):
            strength = inverse[j] * (high[j] - low[j])
            fx += dx[j] * strength
            fy += dy[j] * strength
        out[0, i] = scale * fx
        out[1, i] = scale * fy


@compiled
def adhesion_energy(targets: Array, sources: Array, distance: float, m: int, n: int) -> float:
    """Σ Σ (δ/r)^m − (m/n)(δ/r)^n over ``targets`` (2, t) and ``sources`` (2, s)."""
    dx, dy, inverse, high, low = np.empty((5, sources.shape[1]))
    ratio = m / n
    total = 0.0
    for i in range(targets.shape[1]):
        square = distance * distance
        potential_row(targets[0, i], targets[1, i], sources, square, m, n, dx, dy, inverse, high, low)
        for j in range(sources.shape[1]):
            total += high[j] - ratio * low[j]
    return total


@compiled
def adhesion_hessian(
    targets: Array,
    sources: Array,
    distance: float,
    m: int,
    n: int,
    scale: float,
    xx: Array,
    xy: Array,
    yy: Array,
) -> None:
    """Fill the components (t, s) of the derivative of each pair's force by the target's position."""
    dx, dy, inverse, high, low = np.empty((5, sources.shape[1]))
    for i in range(targets.shape[1]):
        square = distance * distance
        potential_row(targets[0, i], targets[1, i], sources, square, m, n, dx, dy, inverse, high, low)
        for j in range(sources.shape[1]):
            strength = scale * inverse[j] * (high[j] - low[j])
            radial = -scale * inverse[j] * inverse[j] * ((m + 2) * high[j] - (n + 2) * low[j])
            xx[i, j] = strength + radial * dx[j] * dx[j]
            xy[i, j] = radial * dx[j] * dy[j]
            yy[i, j] = strength + radial * dy[j] * dy[j]


@compiled
def adhesion_energies(
    points: Array, spacing: Array, refinement: Refinement, distance: float, m: int, n: int
) -> float:
    """∫∫ (δ/r)^m − (m/n)(δ/r)^n ds ds, half the sum over all vesicles and all other curves."""
    total = 0.0
    for g in range(refinement.groups.shape[0]):
        target, source, factor = refinement.groups[g]
        rows = refinement.rows[refinement.starts[g] : refinement.starts[g + 1]]
        fine = refined_points(points, source, factor, refinement)
        pair = adhesion_energy(points[:, target][:, rows], fine, distance, m, n)
        total += 0.5 * spacing[target] * spacing[source] / factor * pair
    return total


@compiled
def adhesion_density(
    points: Array,
    spacing: Array,
    refinement: Refinement,
    distance: float,
    m: int,
    n: int,
    strength: float,
    density: Array,
) -> None:
    """Add the adhesion force per length on every point to ``density`` (2, M, N)."""
    for g in range(refinement.groups.shape[0]):
        target, source, factor = refinement.groups[g]
        rows = refinement.rows[refinement.starts[g] : refinement.starts[g + 1]]
        fine = refined_points(points, source, factor, refinement)
        force = np.empty((2, rows.size))
        scale = strength * spacing[source] / factor
        adhesion_force(points[:, target][:, rows], fine, distance, m, n, scale, force)
        for k in range(rows.size):
            density[0, target, rows[k]] += force[0, k]
            density[1, target, rows[k]] += force[1, k]


@compiled
def adhesion_hessians(
    points: Array,
    spacing: Array,
    refinement: Refinement,
    distance: float,
    m: int,
    n: int,
    strength: float,
    hessian: Array,
) -> None:
    """Fill the derivative (2, M·N, 2, C·N) of `adhesion_density` by all curves' points."""
    size = points.shape[2]
    hessian[:] = 0.0
    for g in range(refinement.groups.shape[0]):
        target, source, factor = refinement.groups[g]
        rows = refinement.rows[refinement.starts[g] : refinement.starts[g + 1]]
        fine = refined_points(points, source, factor, refinement)
        pair = np.empty((3, rows.size, fine.shape[1]))
        scale = strength * spacing[source] / factor
        targets = points[:, target][:, rows]
        adhesion_hessian(targets, fine, distance, m, n, scale, pair[0], pair[1], pair[2])
        first, last = source * size, (source + 1) * size
        for component, (a, b) in enumerate(((0, 0), (0, 1), (1, 1))):
            each = pair[component]
            folded = each if factor == 1 else np.dot(each, interpolation_to(refinement, factor))
            for k in range(rows.size):
                row = target * size + rows[k]
                hessian[a, row, b, first:last] = -folded[k]
                hessian[a, row, b, row] += each[k].sum()
    hessian[1, :, 0] = hessian[0, :, 1]
