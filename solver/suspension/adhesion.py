"""Adhesion among many vesicles: all points attract and repel all points of other vesicles.

Between vesicles that are far apart by the trapezoid rule; for near targets the source is refined, as for
few vesicles (`solver.adhesion`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver import scene
from solver.adhesion_kernels import adhesion_energy, adhesion_force, adhesion_hessian, potential_row
from solver.compilation import compiled
from solver.geometry import Geometry
from solver.parallel import Parallel, Shares
from solver.proximity import Proximity
from solver.quadrature import required_ratio, trapezoid_error
from solver.refinement import MAXIMUM_FACTOR, Refinement, refined_points, sum_costs, within

Array = NDArray[np.float64]

_FEWEST = 16  # points that a vesicle is seen by
_CHUNK = 256  # sources of which all terms stay in the first cache


@compiled
def _gather_sources(
    points: Array, spacing: Array, centers: Array, radii: Array, target: int, needed: float, sources: Array
) -> int:
    """Write points and spacings (3, ·) by which a vesicle sees the others; return how many these are.

    Far away every second point serves, farther still every fourth, and so on.  The sum over n points of a
    circle of radius R errs by (1 + d/R)^−n at the distance d; ``needed`` is how many e-folds that shall be.
    """
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
def _add_forces(
    points: Array,
    spacing: Array,
    refinement: Refinement,
    distance: float,
    m: int,
    n: int,
    centers: Array,
    needed: float,
    strength: float,
    first: int,
    density: Array,
) -> None:
    """Add the adhesion force per length to ``density`` (2, rows), which begins with the point ``first``."""
    count, size = points.shape[1], points.shape[2]
    last = first + density.shape[1]
    radii = np.empty(count)
    for vesicle in range(count):
        dx, dy = points[0, vesicle] - centers[0, vesicle], points[1, vesicle] - centers[1, vesicle]
        radii[vesicle] = np.sqrt(np.max(dx * dx + dy * dy))
    sources = np.empty((3, count * size))
    for target in range(first // size, (last + size - 1) // size):
        used = _gather_sources(points, spacing, centers, radii, target, needed, sources)
        for begin in range(0, used, _CHUNK):
            seen = np.ascontiguousarray(sources[:, begin : min(begin + _CHUNK, used)])
            weights = seen[2]
            dx, dy, inverse, high, low = np.empty((5, weights.size))
            for point in range(max(first, target * size), min(last, (target + 1) * size)):
                x, y = points[0, target, point - target * size], points[1, target, point - target * size]
                potential_row(x, y, seen, distance * distance, m, n, dx, dy, inverse, high, low)
                force_x = 0.0
                force_y = 0.0
                for j in range(weights.size):
                    pull = weights[j] * inverse[j] * (high[j] - low[j])
                    force_x += dx[j] * pull
                    force_y += dy[j] * pull
                density[0, point - first] += strength * force_x
                density[1, point - first] += strength * force_y
    for g in range(refinement.groups.shape[0]):
        target, source, factor = refinement.groups[g]
        rows = refinement.rows[refinement.starts[g] : refinement.starts[g + 1]]
        targets = points[:, target][:, rows]
        force, plain = np.empty((2, rows.size)), np.empty((2, rows.size))
        scale = strength * spacing[source]
        fine = refined_points(points, source, factor, refinement)
        adhesion_force(targets, fine, distance, m, n, scale / factor, force)
        adhesion_force(targets, points[:, source], distance, m, n, scale, plain)
        for k in range(rows.size):
            point = target * size + rows[k] - first
            density[0, point] += force[0, k] - plain[0, k]
            density[1, point] += force[1, k] - plain[1, k]


@compiled
def _add_energies(
    points: Array,
    spacing: Array,
    refinement: Refinement,
    distance: float,
    m: int,
    n: int,
    first: int,
    energies: Array,
) -> None:
    """Add ½∫∫ (δ/r)^m − (m/n)(δ/r)^n ds ds over all other vesicles to ``energies`` (rows,)."""
    count, size = points.shape[1], points.shape[2]
    for point in range(first, first + energies.size):
        target, row = point // size, point % size
        here = np.ascontiguousarray(points[:, target, row : row + 1])
        for source in range(count):
            if source != target:
                scale = 0.5 * spacing[target] * spacing[source]
                energies[point - first] += scale * adhesion_energy(here, points[:, source], distance, m, n)
    for g in range(refinement.groups.shape[0]):
        target, source, factor = refinement.groups[g]
        fine = refined_points(points, source, factor, refinement)
        scale = 0.5 * spacing[target] * spacing[source]
        for k in range(refinement.starts[g], refinement.starts[g + 1]):
            row = refinement.rows[k]
            here = np.ascontiguousarray(points[:, target, row : row + 1])
            better = adhesion_energy(here, fine, distance, m, n) / factor
            plain = adhesion_energy(here, points[:, source], distance, m, n)
            energies[target * size + row - first] += scale * (better - plain)


@compiled
def _stiffnesses(
    points: Array,
    spacing: Array,
    refinement: Refinement,
    distance: float,
    m: int,
    n: int,
    strength: float,
    first: int,
    stiffness: Array,
) -> None:
    """Add the derivative of the force density by its own point, components (3, rows)."""
    count, size = points.shape[1], points.shape[2]
    for point in range(first, first + stiffness.shape[1]):
        target, row = point // size, point % size
        here = np.ascontiguousarray(points[:, target, row : row + 1])
        pair = np.empty((3, 1, size))
        for source in range(count):
            if source != target:
                scale = strength * spacing[source]
                adhesion_hessian(here, points[:, source], distance, m, n, scale, pair[0], pair[1], pair[2])
                for component in range(3):
                    stiffness[component, point - first] += pair[component, 0].sum()
    for g in range(refinement.groups.shape[0]):
        target, source, factor = refinement.groups[g]
        rows = refinement.rows[refinement.starts[g] : refinement.starts[g + 1]]
        targets = points[:, target][:, rows]
        fine = refined_points(points, source, factor, refinement)
        better, plain = np.empty((3, rows.size, fine.shape[1])), np.empty((3, rows.size, size))
        scale = strength * spacing[source]
        adhesion_hessian(targets, fine, distance, m, n, scale / factor, better[0], better[1], better[2])
        adhesion_hessian(targets, points[:, source], distance, m, n, scale, plain[0], plain[1], plain[2])
        for k in range(rows.size):
            for component in range(3):
                change = better[component, k].sum() - plain[component, k].sum()
                stiffness[component, target * size + rows[k] - first] += change


class SummedAdhesion:
    """Adhesion among many vesicles.

    Parameters
    ----------
    parameters : scene.Adhesion
    accuracy : float
        Relative error allowed in the force between two nearly parallel membranes.
    parallel : Parallel
        The points that the forces act on are shared out among these ranks.

    Attributes
    ----------
    ratio : float
        Distance over spacing below which sources are refined for a target.
    """

    def __init__(self, parameters: scene.Adhesion, accuracy: float, parallel: Parallel) -> None:
        m, n = parameters.exponents
        self._parallel = parallel
        self._potential = parameters.distance, m, n
        self._hamaker = parameters.hamaker
        self._order = 0.5 * m + 1
        self._needed = -2 * float(np.log(accuracy))  # twice, as vesicles are no circles; measured
        self.ratio = required_ratio(self._order, accuracy)

    def density(self, geometry: Geometry, neighbors: Proximity) -> Array:
        """Force per length, (2, M, N)."""
        shares, arguments = self._share(geometry, neighbors)
        own = shares.own
        density = np.zeros((2, own.stop - own.start))
        strength = self._hamaker * self._potential[1]
        _add_forces(*arguments, geometry.centers, self._needed, strength, own.start, density)
        return shares.gather(density, axis=1).reshape(geometry.points.shape)

    def stiffness(self, geometry: Geometry, neighbors: Proximity) -> Array:
        """Derivative of the density at each point by that point, (3, M, N): xx, xy and yy."""
        shares, arguments = self._share(geometry, neighbors)
        own = shares.own
        stiffness = np.zeros((3, own.stop - own.start))
        _stiffnesses(*arguments, self._hamaker * self._potential[1], own.start, stiffness)
        return shares.gather(stiffness, axis=1).reshape(3, *geometry.points.shape[1:])

    def energy(self, geometry: Geometry, neighbors: Proximity) -> float:
        """∫∫ φ ds ds summed over all pairs."""
        shares, arguments = self._share(geometry, neighbors)
        own = shares.own
        energies = np.zeros(own.stop - own.start)
        _add_energies(*arguments, own.start, energies)
        return float(self._hamaker * shares.gather(energies).sum())

    def sum_error(self, neighbors: Proximity) -> float:
        """Relative error of the force between the closest membranes, refined as far as it goes."""
        return trapezoid_error(self._order, MAXIMUM_FACTOR * min(neighbors.nearest, self.ratio))

    def _share(self, geometry: Geometry, neighbors: Proximity) -> tuple[Shares, tuple[Any, ...]]:
        """Which points are this rank's, and what the compiled sums over all pairs are given."""
        refinement = neighbors.refinement(self.ratio)
        points, spacing = geometry.points, geometry.membranes.spacing
        size = points[0].size

        def costs() -> Array:
            each = (1.0 + refinement.groups[:, 2]) * points.shape[2]
            return size + sum_costs(refinement, each, size)

        shares = self._parallel.divide(size, costs)
        return shares, (points, spacing, within(refinement, shares.own, size), *self._potential)
