"""Adhesion between the membranes of different vesicles.

The pair potential φ(r) = H[(δ/r)^m − (m/n)(δ/r)^n] (paper, eq. 2) gives the force density
f(x) = −∇ ∫ φ ds_y = H m ∫ (x−y)/r² [(δ/r)^m − (δ/r)^n] ds_y: repulsive for r < δ.  (The printed equation 3
has the opposite sign.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver import scene
from solver.forces.adhesion_sums import AnyPotential, add_density, fill_hessian, summed_energy
from solver.forces.power_law import Potential
from solver.membrane.geometry import Geometry
from solver.parallel import SERIAL, Parallel, Shares
from solver.potentials.proximity import Proximity
from solver.potentials.quadrature import required_ratio, trapezoid_error
from solver.potentials.refinement import MAXIMUM_FACTOR, Refinement, sum_costs, within

Array = NDArray[np.float64]


class AdhesionBase:
    """What all kinds of adhesion have in common: a potential, and how ranks share the points it acts on.

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
        Distance over spacing to which sources are refined for a target.
    """

    def __init__(self, parameters: scene.Adhesion, accuracy: float, parallel: Parallel) -> None:
        self._parallel = parallel
        m, n = parameters.exponents
        self._potential: AnyPotential = Potential(parameters.distance, m, n)
        self._hamaker = parameters.hamaker
        self._strength = parameters.hamaker * m  # by which the kernels of the force are multiplied
        # Over a nearly straight membrane the force kernel is like 1/(s² + d²)^(m/2 + 1).
        self._order = 0.5 * m + 1
        self.ratio = required_ratio(self._order, accuracy)

    def sum_error(self, closeness: Proximity) -> float:
        """Relative error of the force between the closest membranes, refined as far as it goes."""
        return trapezoid_error(self._order, MAXIMUM_FACTOR * min(closeness.nearest, self.ratio))

    def _share(
        self, geometry: Geometry, refinement: Refinement, curves: int = 0, again: int = 0
    ) -> tuple[Shares, Refinement]:
        """How the points are shared out, and this rank's part of a refinement.

        Every point costs sums over so many ``curves`` as they are, and ``again`` one for each of its groups,
        beside those over refined ones.
        """
        size = geometry.points[0].size
        shares = self._parallel.divide(
            size, lambda: curves + sum_costs(refinement, again + refinement.groups[:, 2].astype(float), size)
        )
        return shares, within(refinement, shares.own, size)

    def _total(self, energy: float, geometry: Geometry) -> float:
        """The energy of all ranks' points and of their images, from φ/H summed over this rank's points."""
        each = self._parallel.divide(self._parallel.size).gather(np.array([energy]))
        return float(geometry.membranes.copies * self._hamaker * each.sum())


class Adhesion(AdhesionBase):
    """Adhesion over all pairs of a few vesicles; see `AdhesionBase`."""

    def __init__(self, parameters: scene.Adhesion, accuracy: float, parallel: Parallel = SERIAL) -> None:
        super().__init__(parameters, accuracy, parallel)

    def density(self, geometry: Geometry, closeness: Proximity) -> Array:
        """Force per length, (2, M, N)."""
        shares, sums = self._sums(geometry, closeness)
        density = np.zeros_like(geometry.points)
        add_density(*sums, self._strength, density)
        return gathered(shares, density)

    def jacobian(self, geometry: Geometry, closeness: Proximity) -> Array:
        """Derivative of `density` by the state, (2, M·N, state)."""
        membranes = geometry.membranes
        size = membranes.count * membranes.points
        hessian = np.empty((2, size, 2, membranes.copies * size))
        shares, sums = self._sums(geometry, closeness)
        fill_hessian(*sums, self._strength, hessian)
        own = hessian[:, shares.own]
        return shares.gather(geometry.by_state(membranes.fold(own)), axis=1)

    def energy(self, geometry: Geometry, closeness: Proximity) -> float:
        """∫∫ φ ds ds summed over all pairs."""
        _, sums = self._sums(geometry, closeness)
        return self._total(summed_energy(*sums), geometry)

    def _sums(self, geometry: Geometry, closeness: Proximity) -> tuple[Shares, tuple[Any, ...]]:
        """How the points are shared out, and what the compiled sums over this rank's are given."""
        refinement = self._refinement(closeness)
        shares, own = self._share(geometry, refinement)
        return shares, (geometry.curve_points, geometry.membranes.curve_spacing, own, self._potential)

    def _refinement(self, closeness: Proximity) -> Refinement:
        return closeness.refinement(self.ratio)


def gathered(shares: Shares, values: Array) -> Array:
    """Values (k, M, N) at all points, of which this rank has found those of its share."""
    own = values.reshape(len(values), -1)[:, shares.own]
    return shares.gather(own, axis=1).reshape(values.shape)
