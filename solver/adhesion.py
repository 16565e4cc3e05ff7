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
from solver.adhesion_kernels import adhesion_density, adhesion_energies, adhesion_hessians
from solver.geometry import Geometry
from solver.parallel import SERIAL, Parallel, Shares
from solver.proximity import Proximity
from solver.quadrature import required_ratio, trapezoid_error
from solver.refinement import MAXIMUM_FACTOR, Refinement, sum_costs, within

Array = NDArray[np.float64]


class Adhesion:
    """Adhesion over all pairs of vesicles.

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

    def __init__(self, parameters: scene.Adhesion, accuracy: float, parallel: Parallel = SERIAL) -> None:
        self._parallel = parallel
        m, n = parameters.exponents
        self._potential = parameters.distance, m, n
        self._hamaker = parameters.hamaker
        # Over a nearly straight membrane the force kernel is like 1/(s² + d²)^(m/2 + 1).
        self._order = 0.5 * m + 1
        self.ratio = required_ratio(self._order, accuracy)

    def density(self, geometry: Geometry, closeness: Proximity) -> Array:
        """Force per length, (2, M, N)."""
        density = np.zeros_like(geometry.points)
        shares, arguments = self._share(geometry, closeness)
        adhesion_density(*arguments, density)
        own = density.reshape(2, -1)[:, shares.own]
        return shares.gather(own, axis=1).reshape(density.shape)

    def jacobian(self, geometry: Geometry, closeness: Proximity) -> Array:
        """Derivative of `density` by the state, (2, M·N, state)."""
        membranes = geometry.membranes
        size = membranes.count * membranes.points
        hessian = np.empty((2, size, 2, membranes.copies * size))
        shares, arguments = self._share(geometry, closeness)
        adhesion_hessians(*arguments, hessian)
        own = hessian[:, shares.own]
        return shares.gather(geometry.by_state(membranes.fold(own)), axis=1)

    def _share(self, geometry: Geometry, closeness: Proximity) -> tuple[Shares, tuple[Any, ...]]:
        """Which points are this rank's, and what the compiled sums of forces on them are given."""
        refinement = closeness.refinement(self.ratio)
        size = geometry.membranes.count * geometry.membranes.points
        shares = self._parallel.divide(
            size, lambda: sum_costs(refinement, refinement.groups[:, 2].astype(float), size)
        )
        sums = self._sums(geometry, within(refinement, shares.own, size))
        return shares, (*sums, self._hamaker * self._potential[1])

    def _sums(self, geometry: Geometry, refinement: Refinement) -> tuple[Any, ...]:
        return geometry.curve_points, geometry.membranes.curve_spacing, refinement, *self._potential

    def sum_error(self, closeness: Proximity) -> float:
        """Relative error of the force between the closest membranes, refined as far as it goes."""
        return trapezoid_error(self._order, MAXIMUM_FACTOR * closeness.nearest)

    def energy(self, geometry: Geometry, closeness: Proximity) -> float:
        """∫∫ φ ds ds summed over all pairs."""
        energy = adhesion_energies(*self._sums(geometry, closeness.refinement(self.ratio)))
        return float(geometry.membranes.copies * self._hamaker * energy)
