"""Adhesion among many vesicles, all points of which act on all points of the others.

What is far away is summed over fewer points (`clustered_sources`).  For targets near a vesicle the difference
between the sums over its refined points and over its points is added.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from solver.forces.adhesion import DirectAdhesion, Everywhere, gather_points, total_energy
from solver.forces.clustered_sources import clusters_of
from solver.forces.clustered_sums import add_clustered_density, add_clustered_stiffness, clustered_energy
from solver.forces.pair_formulas import formula_and_parameters
from solver.forces.pair_sums import add_density, add_stiffness, summed_energy
from solver.potentials.refinement import sum_costs, within
from solver.potentials.vesicle_tree import vesicle_tree

if TYPE_CHECKING:
    from solver.membrane.geometry import Geometry, Membranes
    from solver.pair_potentials.pair_potential import PairPotential
    from solver.parallel import Parallel, Shares
    from solver.potentials.proximity import Proximity

Array = NDArray[np.float64]

# Measured: the points along a side, for each digit of accuracy, with which sums cost least, and the part of
# the error that each of the many nodes is allowed.
_ORDER_PER_DIGIT = 0.75
_PART = 0.3


class CoarsenedAdhesion:
    """Adhesion over all pairs of many vesicles, without a cutoff.

    Parameters
    ----------
    potential : PairPotential
    accuracy : float
        Relative error allowed in the force between two nearly parallel membranes.
    parallel : Parallel
        The points that the forces act on are shared out among these ranks.
    """

    def __init__(self, potential: PairPotential, accuracy: float, parallel: Parallel) -> None:
        self._range = Everywhere(potential.singularity, accuracy)
        self._law = formula_and_parameters(potential)
        self._hamaker = potential.hamaker
        self._parallel = parallel
        self._accuracy = accuracy
        self._order = max(round(-_ORDER_PER_DIGIT * float(np.log10(accuracy))), 3)

    @property
    def reach(self) -> float:
        """Distance over spacing within which sources are refined for a target."""
        return self._range.reach

    def density(self, geometry: Geometry, neighbors: Proximity) -> Array:
        """Compute the force per length.

        Collective.

        Parameters
        ----------
        geometry : Geometry
        neighbors : Proximity
            Of this geometry, at least to `reach`.

        Returns
        -------
        (2, M, N)
        """
        shares, refined, plain = self._sums(geometry, neighbors)
        density = np.zeros_like(geometry.points)
        add_clustered_density(*self._everyone(geometry, self._accuracy, shares), self._hamaker, density)
        add_density(*refined, self._hamaker, density)
        add_density(*plain, -self._hamaker, density)
        return gather_points(shares, density)

    def stiffness(self, geometry: Geometry, neighbors: Proximity) -> Array:
        """Compute the derivative of the density at each point by that point.

        Collective.

        Parameters
        ----------
        geometry : Geometry
        neighbors : Proximity
            As for `density`.

        Returns
        -------
        (3, M, N)
            Its components xx, xy and yy.
        """
        shares, refined, plain = self._sums(geometry, neighbors)
        stiffness = np.zeros((3, *geometry.points.shape[1:]))
        add_clustered_stiffness(*self._everyone(geometry, self._accuracy, shares), self._hamaker, stiffness)
        add_stiffness(*refined, self._hamaker, stiffness)
        add_stiffness(*plain, -self._hamaker, stiffness)
        return gather_points(shares, stiffness)

    def energy(self, geometry: Geometry, neighbors: Proximity) -> float:
        """Compute ½∫∫ φ ds ds over all pairs of vesicles.

        Collective.

        Parameters
        ----------
        geometry : Geometry
        neighbors : Proximity
            As for `density`.

        Returns
        -------
        float
        """
        shares, refined, plain = self._sums(geometry, neighbors)
        energy = summed_energy(*refined) - summed_energy(*plain)
        # With the distance the energy falls off more slowly than the force.
        energy += clustered_energy(*self._everyone(geometry, 0.1 * self._accuracy, shares))
        return total_energy(self._parallel, geometry, self._hamaker * energy)

    def sum_error(self, neighbors: Proximity) -> float:
        """Compute the relative error of the force between the closest membranes, refined as far as it goes.

        Parameters
        ----------
        neighbors : Proximity

        Returns
        -------
        float
        """
        return self._range.sum_error(neighbors)

    def _sums(
        self, geometry: Geometry, neighbors: Proximity
    ) -> tuple[Shares, tuple[Any, ...], tuple[Any, ...]]:
        """How the points are shared out, and the arguments of this rank's compiled sums over near curves.

        Those over refined ones, and those over the same unrefined, which are part of the sum over all.
        """
        refinement = self._range.refinement(neighbors)
        points, spacing = geometry.points, geometry.membranes.spacing
        size = points[0].size

        def costs() -> Array:
            near = sum_costs(refinement, refinement.groups[:, 2] + np.float64(1), size)
            return near + geometry.membranes.count

        shares = self._parallel.divide(size, costs)
        own = within(refinement, shares.own, size)
        groups = own.groups.copy()
        groups[:, 2] = 1
        unrefined = own._replace(groups=groups)
        return (
            shares,
            (points, spacing, own, *self._law),
            (points, spacing, unrefined, *self._law),
        )

    def _everyone(self, geometry: Geometry, accuracy: float, shares: Shares) -> tuple[Any, ...]:
        """Return the arguments of this rank's compiled sums over all vesicles."""
        points, spacing = geometry.points, geometry.membranes.spacing
        tree = vesicle_tree(geometry.centers, geometry.radii)
        clusters = clusters_of(tree, points, spacing, self._order, _PART * accuracy)
        return *self._law, clusters, points, spacing, shares.own.start, shares.own.stop


def adhesion_of_many(
    potential: PairPotential, accuracy: float, membranes: Membranes, parallel: Parallel
) -> CoarsenedAdhesion | DirectAdhesion:
    """Make the adhesion that many vesicles have.

    Parameters
    ----------
    potential : PairPotential
    accuracy : float
        Relative error allowed in the force between two nearly parallel membranes.
    membranes : Membranes
    parallel : Parallel
        The points that the forces act on are shared out among these ranks.

    Returns
    -------
    CoarsenedAdhesion or DirectAdhesion
        The latter if the potential has a cutoff, within which few pairs of points lie.
    """
    if potential.cutoff is None:
        return CoarsenedAdhesion(potential, accuracy, parallel)
    return DirectAdhesion(potential, accuracy, membranes, parallel)
