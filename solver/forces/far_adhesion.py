"""Sums of the adhesion potential over the points of many vesicles.

Between vesicles that are far apart the trapezoid rule needs few points: every second one serves, farther
still every fourth, and so on.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.forces.power_law import Potential, potential_row
from solver.membrane.geometry import Geometry

Array = NDArray[np.float64]

_FEWEST = 16  # points that a vesicle is seen by
_CHUNK = 256  # sources of which all terms stay in the first cache


def seen(geometry: Geometry, own: slice, needed: float) -> Iterator[tuple[int, slice, Array]]:
    """Which vesicles have points among ``own``, which ones, and the others' points that these see.

    These are points and weights, (3, ·).  The sum over n points of a circle of radius R errs by (1 + d/R)^−n
    at the distance d; ``needed`` is how many e-folds that shall be.
    """
    points, centers, spacing = geometry.points, geometry.centers, geometry.membranes.spacing
    size = points.shape[2]
    sources = np.empty((3, points[0].size))
    for vesicle in range(own.start // size, -(-own.stop // size)):
        used = _gather_sources(points, spacing, centers, geometry.radii, vesicle, needed, sources)
        rows = slice(max(own.start - vesicle * size, 0), min(own.stop - vesicle * size, size))
        yield vesicle, rows, sources[:, :used]


@compiled
def _gather_sources(
    points: Array, spacing: Array, centers: Array, radii: Array, target: int, needed: float, sources: Array
) -> int:
    """Write points and weights (3, ·) by which a vesicle sees the others; return how many these are."""
    count, n = points.shape[1], points.shape[2]
    used = 0
    for source in range(count):
        if source == target:
            continue
        dx, dy = centers[0, source] - centers[0, target], centers[1, source] - centers[1, target]
        apart = np.sqrt(dx * dx + dy * dy) - radii[source] - radii[target]
        decay = np.log1p(max(apart, 0.0) / radii[source])
        step = 1
        while n % (2 * step) == 0 and n >= _FEWEST * 2 * step and n * decay >= needed * 2 * step:
            step *= 2
        for i in range(0, n, step):
            sources[0, used] = points[0, source, i]
            sources[1, used] = points[1, source, i]
            sources[2, used] = spacing[source] * step
            used += 1
    return used


@compiled
def add_far_density(
    targets: Array, sources: Array, potential: Potential, strength: float, density: Array
) -> None:
    """Add the force per length on targets (2, t) to ``density`` (2, t)."""
    for begin in range(0, sources.shape[1], _CHUNK):
        near = np.ascontiguousarray(sources[:, begin : begin + _CHUNK])
        weights = near[2]
        dx, dy, inverse, high, low = np.empty((5, weights.size))
        for i in range(targets.shape[1]):
            potential_row(targets[0, i], targets[1, i], near, potential, dx, dy, inverse, high, low)
            force_x = 0.0
            force_y = 0.0
            for j in range(weights.size):
                pull = weights[j] * inverse[j] * (high[j] - low[j])
                force_x += dx[j] * pull
                force_y += dy[j] * pull
            density[0, i] += strength * force_x
            density[1, i] += strength * force_y


@compiled
def far_energy(targets: Array, sources: Array, potential: Potential) -> float:
    """Σ φ/H over targets (2, t) and, by their weights, the sources."""
    ratio = potential.m / potential.n
    total = 0.0
    for begin in range(0, sources.shape[1], _CHUNK):
        near = np.ascontiguousarray(sources[:, begin : begin + _CHUNK])
        weights = near[2]
        dx, dy, inverse, high, low = np.empty((5, weights.size))
        for i in range(targets.shape[1]):
            potential_row(targets[0, i], targets[1, i], near, potential, dx, dy, inverse, high, low)
            for j in range(weights.size):
                total += weights[j] * (high[j] - ratio * low[j])
    return total


@compiled
def add_far_stiffness(
    targets: Array, sources: Array, potential: Potential, strength: float, stiffness: Array
) -> None:
    """Add the derivative of `add_far_density` by each target's position to ``stiffness`` (3, t)."""
    m, n = potential.m, potential.n
    for begin in range(0, sources.shape[1], _CHUNK):
        near = np.ascontiguousarray(sources[:, begin : begin + _CHUNK])
        weights = near[2]
        dx, dy, inverse, high, low = np.empty((5, weights.size))
        for i in range(targets.shape[1]):
            potential_row(targets[0, i], targets[1, i], near, potential, dx, dy, inverse, high, low)
            xx = 0.0
            xy = 0.0
            yy = 0.0
            for j in range(weights.size):
                scale = weights[j] * inverse[j]
                straight = scale * (high[j] - low[j])
                radial = -scale * inverse[j] * ((m + 2) * high[j] - (n + 2) * low[j])
                xx += straight + radial * dx[j] * dx[j]
                xy += radial * dx[j] * dy[j]
                yy += straight + radial * dy[j] * dy[j]
            stiffness[0, i] += strength * xx
            stiffness[1, i] += strength * xy
            stiffness[2, i] += strength * yy
