"""Adhesion among many vesicles: all points attract and repel all points of other vesicles.

By the trapezoid rule, and for near targets by what a refined source (`solver.forces.adhesion`) changes in it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver import scene
from solver.forces.adhesion import AdhesionBase, gathered
from solver.forces.adhesion_sums import add_density, add_stiffness, summed_energy
from solver.forces.far_adhesion import add_far_density, add_far_stiffness, far_energy, seen
from solver.membrane.geometry import Geometry
from solver.parallel import Parallel, Shares
from solver.potentials.proximity import Proximity

Array = NDArray[np.float64]


class SummedAdhesion(AdhesionBase):
    """Adhesion over all pairs of many vesicles; see `AdhesionBase`.

    Attributes
    ----------
    reach : float
        Distance over spacing within which sources are refined for a target.
    """

    def __init__(self, parameters: scene.Adhesion, accuracy: float, parallel: Parallel) -> None:
        super().__init__(parameters, accuracy, parallel)
        self._needed = -2 * float(np.log(accuracy))  # twice, as vesicles are no circles; measured
        self.reach = self.ratio

    def density(self, geometry: Geometry, neighbors: Proximity) -> Array:
        """Force per length, (2, M, N)."""
        shares, refined, plain = self._sums(geometry, neighbors)
        density = np.zeros_like(geometry.points)
        for vesicle, rows, sources in seen(geometry, shares.own, self._needed):
            targets = geometry.points[:, vesicle, rows]
            add_far_density(targets, sources, self._potential, self._strength, density[:, vesicle, rows])
        add_density(*refined, self._strength, density)
        add_density(*plain, -self._strength, density)
        return gathered(shares, density)

    def stiffness(self, geometry: Geometry, neighbors: Proximity) -> Array:
        """Derivative of the density at each point by that point, (3, M, N): xx, xy and yy."""
        shares, refined, plain = self._sums(geometry, neighbors)
        stiffness = np.zeros((3, *geometry.points.shape[1:]))
        for vesicle, rows, sources in seen(geometry, shares.own, self._needed):
            targets = geometry.points[:, vesicle, rows]
            add_far_stiffness(targets, sources, self._potential, self._strength, stiffness[:, vesicle, rows])
        add_stiffness(*refined, self._strength, stiffness)
        add_stiffness(*plain, -self._strength, stiffness)
        return gathered(shares, stiffness)

    def energy(self, geometry: Geometry, neighbors: Proximity) -> float:
        """∫∫ φ ds ds summed over all pairs."""
        shares, refined, plain = self._sums(geometry, neighbors)
        energy = summed_energy(*refined) - summed_energy(*plain)
        for vesicle, rows, sources in seen(geometry, shares.own, self._needed):
            far = far_energy(geometry.points[:, vesicle, rows], sources, self._potential)
            energy += 0.5 * geometry.membranes.spacing[vesicle] * far
        return self._total(energy, geometry)

    def _sums(
        self, geometry: Geometry, neighbors: Proximity
    ) -> tuple[Shares, tuple[Any, ...], tuple[Any, ...]]:
        """How the points are shared out, and what the compiled sums over near curves are given.

        Those over refined ones, and those over the same as they are, which are part of the sum over all.
        """
        refinement = neighbors.refinement(self.ratio)
        points, spacing = geometry.points, geometry.membranes.spacing
        shares, own = self._share(geometry, refinement, curves=geometry.membranes.count, again=1)
        as_they_are = own.groups.copy()
        as_they_are[:, 2] = 1
        plain = own._replace(groups=as_they_are)
        return (
            shares,
            (points, spacing, own, self._potential),
            (points, spacing, plain, self._potential),
        )
