"""Adhesion between the membranes of different vesicles.

The pair potential φ(r) = H[(δ/r)^m − (m/n)(δ/r)^n] (paper, eq. 2) gives the force density
f(x) = −∇ ∫ φ ds_y = H m ∫ (x−y)/r² [(δ/r)^m − (δ/r)^n] ds_y: repulsive for r < δ.  (The printed equation 3
has the opposite sign.)
"""

from __future__ import annotations

from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from solver import scene
from solver.geometry import Geometry
from solver.kernels import adhesion_energy, adhesion_force, adhesion_hessian
from solver.proximity import Closeness
from solver.quadrature import required_ratio
from solver.spectral import interpolation

Array = NDArray[np.float64]


class Adhesion:
    """Adhesion over all pairs of vesicles.

    Parameters
    ----------
    parameters : scene.Adhesion
    accuracy : float
        Relative error allowed in the force between two nearly parallel membranes.
    """

    def __init__(self, parameters: scene.Adhesion, accuracy: float) -> None:
        m, n = parameters.exponents
        self._potential = parameters.distance, m, n
        self._hamaker = parameters.hamaker
        # Over a nearly straight membrane the force kernel is like 1/(s² + d²)^(m/2 + 1).
        self._ratio = required_ratio(0.5 * m + 1, accuracy)

    def density(self, geometry: Geometry, closeness: Closeness) -> Array:
        """Force per length, (2, M, N)."""
        points, spacing = geometry.points, geometry.membranes.spacing
        strength = self._hamaker * self._potential[1]
        density = np.zeros_like(points)
        force = np.empty((2, geometry.membranes.points))
        for target, source in permutations(range(len(spacing)), 2):
            targets, sources = points[:, target], points[:, source]
            adhesion_force(targets, sources, *self._potential, strength * spacing[source], force)
            for near in closeness.refinements(target, source, self._ratio):
                refined = np.empty_like(near.targets)
                scale = strength * spacing[source] / near.factor
                adhesion_force(near.targets, near.sources, *self._potential, scale, refined)
                force[:, near.rows] = refined
            density[:, target] += force
        return density

    def jacobian(self, geometry: Geometry, closeness: Closeness, dx: Array, dy: Array) -> tuple[Array, Array]:
        """Derivatives of both components by the state, (M·N, state) each, given those of the points."""
        membranes = geometry.membranes
        points = membranes.points
        size = membranes.count * points
        hessian = np.zeros((3, size, size))
        for target, source in permutations(range(membranes.count), 2):
            rows = slice(target * points, (target + 1) * points)
            columns = slice(source * points, (source + 1) * points)
            pair = self._hessian(
                geometry.points[:, target], geometry.points[:, source], membranes.spacing[source]
            )
            own = pair.sum(axis=-1)
            for near in closeness.refinements(target, source, self._ratio):
                fine = self._hessian(near.targets, near.sources, membranes.spacing[source] / near.factor)
                own[:, near.rows] = fine.sum(axis=-1)
                pair[:, near.rows] = fine @ near.interpolation
            np.negative(pair, out=hessian[:, rows, columns])
            diagonal = np.arange(rows.start, rows.stop)
            hessian[:, diagonal, diagonal] += own
        xx, xy, yy = hessian
        return xx @ dx + xy @ dy, xy @ dx + yy @ dy

    def _hessian(self, targets: Array, sources: Array, spacing: float) -> Array:
        components = np.empty((3, targets.shape[1], sources.shape[1]))
        scale = self._hamaker * self._potential[1] * spacing
        adhesion_hessian(targets, sources, *self._potential, scale, *components)
        return components

    def energy(self, geometry: Geometry, refinement: int = 2) -> float:
        """∫∫ φ ds ds summed over all pairs, on points interpolated ``refinement`` times."""
        points = geometry.points @ interpolation(geometry.membranes.points, refinement).T
        spacing = geometry.membranes.spacing / refinement
        total = 0.0
        for first, second in combinations(range(len(spacing)), 2):
            pair = adhesion_energy(points[:, first], points[:, second], *self._potential)
            total += spacing[first] * spacing[second] * pair
        return self._hamaker * total
