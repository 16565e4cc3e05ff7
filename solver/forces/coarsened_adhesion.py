"""Adhesion among many vesicles, all points of which act on all points of the others.

Between vesicles that are far apart the trapezoid rule needs few points: every second one, farther still every
fourth, and so on.  For targets near a vesicle the difference between the sums over its refined
points and over its points is added.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.forces.adhesion import DirectAdhesion, Everywhere, gather_points, total_energy
from solver.forces.pair_formulas import formula_and_parameters
from solver.forces.pair_sums import (
    add_density,
    add_forces,
    add_stiffness,
    add_stiffnesses,
    pair_energy,
    summed_energy,
)
from solver.potentials.refinement import sum_costs, within

if TYPE_CHECKING:
    from solver.membrane.geometry import Geometry, Membranes
    from solver.pair_potentials.pair_potential import PairPotential
    from solver.parallel import Parallel, Shares
    from solver.potentials.proximity import Proximity

Array = NDArray[np.float64]

_FEWEST = 16  # points that stand for a vesicle


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
        self._decay = -2 * float(np.log(accuracy))  # twice, as vesicles are no circles; measured

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
        for vesicle, rows, sources, weights in coarsened_sources(geometry, shares.own, self._decay):
            targets = geometry.points[:, vesicle, rows]
            add_forces(*self._law, targets, sources, weights, self._hamaker, density[:, vesicle, rows])
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
        for vesicle, rows, sources, weights in coarsened_sources(geometry, shares.own, self._decay):
            targets = geometry.points[:, vesicle, rows]
            add_stiffnesses(*self._law, targets, sources, weights, self._hamaker, stiffness[:, vesicle, rows])
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
        for vesicle, rows, sources, weights in coarsened_sources(geometry, shares.own, self._decay):
            far = pair_energy(*self._law, geometry.points[:, vesicle, rows], sources, weights)
            energy += 0.5 * geometry.membranes.spacing[vesicle] * far
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


def coarsened_sources(
    geometry: Geometry, own: slice, decay: float
) -> Iterator[tuple[int, slice, Array, Array]]:
    """Iterate over the vesicles that have points in a range, with the points of others that act on them.

    The sum over n points of a circle of radius R errs by (1 + d/R)^−n at the distance d from it.

    Parameters
    ----------
    geometry : Geometry
    own : slice
        Of all M·N points.
    decay : float
        Minus the logarithm of the error allowed.

    Yields
    ------
    vesicle : int
    rows : slice
        Those of its points that are in the range.
    sources : (2, ·)
        Points of the other vesicles.
    weights : (·,)
        Arclength that each source stands for.
    """
    points, centers, spacing = geometry.points, geometry.centers, geometry.membranes.spacing
    size = points.shape[2]
    sources, weights = np.empty((2, points[0].size)), np.empty(points[0].size)
    for vesicle in range(own.start // size, -(-own.stop // size)):
        used = _coarsen(points, spacing, centers, geometry.radii, vesicle, decay, sources, weights)
        rows = slice(max(own.start - vesicle * size, 0), min(own.stop - vesicle * size, size))
        yield vesicle, rows, np.ascontiguousarray(sources[:, :used]), weights[:used]


@compiled
def _coarsen(
    points: Array,
    spacing: Array,
    centers: Array,
    radii: Array,
    target: int,
    decay: float,
    sources: Array,
    weights: Array,
) -> int:
    """Write the points of others that act on a vesicle, and their weights; return how many these are."""
    count, n = points.shape[1], points.shape[2]
    used = 0
    for source in range(count):
        if source == target:
            continue
        dx, dy = centers[0, source] - centers[0, target], centers[1, source] - centers[1, target]
        apart = np.sqrt(dx * dx + dy * dy) - radii[source] - radii[target]
        decay_per_point = np.log1p(max(apart, 0.0) / radii[source])
        step = 1
        while n % (2 * step) == 0 and n >= _FEWEST * 2 * step and n * decay_per_point >= decay * 2 * step:
            step *= 2
        for i in range(0, n, step):
            sources[0, used] = points[0, source, i]
            sources[1, used] = points[1, source, i]
            weights[used] = spacing[source] * step
            used += 1
    return used
