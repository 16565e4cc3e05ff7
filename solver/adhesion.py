"""Adhesion between the membranes of different vesicles.

The pair potential φ(r) = H[(δ/r)^m − (m/n)(δ/r)^n] (paper, eq. 2) gives the force density
f(x) = −∇ ∫ φ ds_y = H m ∫ (x−y)/r² [(δ/r)^m − (δ/r)^n] ds_y: repulsive for r < δ.  (The printed equation 3
has the opposite sign.)
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from solver import scene
from solver.geometry import Geometry
from solver.kernels import adhesion_kernels
from solver.proximity import Refinement
from solver.spectral import interpolation

Array = NDArray[np.float64]


class Adhesion:
    """Adhesion over all pairs of vesicles."""

    def __init__(self, parameters: scene.Adhesion) -> None:
        self.parameters = parameters
        self._kernels = adhesion_kernels(*parameters.exponents)

    @property
    def order(self) -> float:
        """Order q of the force kernel, ~1/(s² + d²)^q over a nearly straight membrane (`quadrature`)."""
        return 0.5 * (self.parameters.exponents[0] + 2)

    @property
    def _strength(self) -> float:
        return self.parameters.hamaker * self.parameters.exponents[0]

    def density(self, geometry: Geometry, refinements: Sequence[Refinement]) -> Array:
        """Force per length, (2, M, N)."""
        points, spacing = geometry.points, geometry.membranes.spacing
        density = np.zeros_like(points)
        contiguous = [np.ascontiguousarray(points[:, vesicle]) for vesicle in range(len(spacing))]
        for target, source in permutations(range(len(spacing)), 2):
            force = np.zeros((2, geometry.membranes.points))
            self._force(contiguous[target], contiguous[source], spacing[source], force)
            for near in refinements:
                if (near.target, near.source) == (target, source):
                    refined = np.zeros_like(near.targets)
                    self._force(near.targets, near.sources, spacing[source] / near.factor, refined)
                    force[:, near.rows] = refined
            density[:, target] += force
        return density

    def _force(self, targets: Array, sources: Array, spacing: float, out: Array) -> None:
        self._kernels.force(targets, sources, self.parameters.distance, self._strength * spacing, out)

    def jacobian(
        self, geometry: Geometry, refinements: Sequence[Refinement], dx: Array, dy: Array
    ) -> tuple[Array, Array]:
        """Derivatives of both components by the state, (M·N, state) each, given those of the points."""
        membranes = geometry.membranes
        points = membranes.points
        size = membranes.count * points
        hessian = np.zeros((3, size, size))
        for target, source in permutations(range(membranes.count), 2):
            rows = slice(target * points, (target + 1) * points)
            columns = slice(source * points, (source + 1) * points)
            targets = np.ascontiguousarray(geometry.points[:, target])
            sources = np.ascontiguousarray(geometry.points[:, source])
            pair = self._hessian(targets, sources, membranes.spacing[source])
            own = pair.sum(axis=-1)
            for near in refinements:
                if (near.target, near.source) == (target, source):
                    fine = self._hessian(near.targets, near.sources, membranes.spacing[source] / near.factor)
                    own[:, near.rows] = fine.sum(axis=-1)
                    pair[:, near.rows] = fine @ near.interpolation
            hessian[:, rows, columns] = -pair
            diagonal = np.arange(rows.start, rows.stop)
            hessian[:, diagonal, diagonal] += own
        xx, xy, yy = hessian
        return xx @ dx + xy @ dy, xy @ dx + yy @ dy

    def _hessian(self, targets: Array, sources: Array, spacing: float) -> Array:
        components = np.empty((3, targets.shape[1], sources.shape[1]))
        self._kernels.hessian(
            targets, sources, self.parameters.distance, self._strength * spacing, *components
        )
        return components

    def energy(self, geometry: Geometry, refinement: int = 2) -> float:
        """∫∫ φ ds ds summed over all pairs, on points interpolated ``refinement`` times."""
        matrix = interpolation(geometry.membranes.points, refinement)
        points = geometry.points @ matrix.T
        spacing = geometry.membranes.spacing / refinement
        total = 0.0
        for first, second in combinations(range(len(spacing)), 2):
            pair = self._kernels.energy(
                np.ascontiguousarray(points[:, first]),
                np.ascontiguousarray(points[:, second]),
                self.parameters.distance,
            )
            total += spacing[first] * spacing[second] * pair
        return self.parameters.hamaker * total
