"""Adhesion between the membranes of different vesicles.

A pair potential φ of any two points gives the energy ½∫∫ φ ds ds over all pairs of vesicles and the force
density f(x) = −∇ ∫ φ ds_y over the other vesicles (Quaife et al. 2019, eq. 3 and appendix B, where the sign
is the opposite).  Integrals are sums by the trapezoid rule, over refined points of a vesicle where a target
is close to it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from solver.forces.pair_formulas import formula_and_parameters
from solver.forces.pair_sums import add_density, add_stiffness, fill_hessian, summed_energy
from solver.membrane.spectral import interpolations
from solver.pair_potentials.cutoff import switch_error
from solver.parallel import SERIAL, Parallel, Shares
from solver.potentials.quadrature import required_ratio, trapezoid_error
from solver.potentials.refinement import MAXIMUM_FACTOR, Refinement, sum_costs, within

if TYPE_CHECKING:
    from solver.membrane.geometry import Geometry, Membranes
    from solver.pair_potentials.pair_potential import PairPotential
    from solver.potentials.proximity import Proximity

Array = NDArray[np.float64]


class InteractionRange(Protocol):
    """Which sources act on a target, and how finely these are sampled.

    Attributes
    ----------
    reach : float
        Distance over spacing within which targets of a source are looked for.
    """

    reach: float

    def refinement(self, closeness: Proximity) -> Refinement:
        """Return the groups of targets and sources.

        Parameters
        ----------
        closeness : Proximity

        Returns
        -------
        Refinement
        """

    def sum_error(self, closeness: Proximity) -> float:
        """Return the relative error of the force between the closest membranes, refined as far as it goes.

        Parameters
        ----------
        closeness : Proximity

        Returns
        -------
        float
        """


class Everywhere:
    """All points of other vesicles act on a target.

    Parameters
    ----------
    singularity : float
        `PairPotential.singularity`.
    accuracy : float
        Relative error allowed in the force between two nearly parallel membranes.

    Attributes
    ----------
    reach : float
        Distance over spacing to which sources are refined for a target.
    """

    def __init__(self, singularity: float, accuracy: float) -> None:
        self._singularity = singularity
        self.reach = required_ratio(singularity, accuracy)

    def refinement(self, closeness: Proximity) -> Refinement:
        """Return the groups of targets and sources; see `InteractionRange`.

        Parameters
        ----------
        closeness : Proximity

        Returns
        -------
        Refinement
        """
        return closeness.refinement(self.reach)

    def sum_error(self, closeness: Proximity) -> float:
        """Return the relative error of the force; see `InteractionRange`.

        Parameters
        ----------
        closeness : Proximity

        Returns
        -------
        float
        """
        return trapezoid_error(self._singularity, MAXIMUM_FACTOR * min(closeness.nearest, self.reach))


class WithinCutoff:
    """Only points within a cutoff act on a target.

    Sources are also refined for the switch, whose fifth derivative jumps.

    Parameters
    ----------
    everywhere : Everywhere
        How sources are refined without a cutoff.
    distance, cutoff : float
        Of the `PairPotential`.
    accuracy : float
        As for `Everywhere`.
    membranes : Membranes

    Attributes
    ----------
    reach : float
        See `InteractionRange`.
    """

    def __init__(
        self, everywhere: Everywhere, distance: float, cutoff: float, accuracy: float, membranes: Membranes
    ) -> None:
        self._everywhere = everywhere
        spacing = float(membranes.spacing.max())
        self._least_factor = 1
        while self._least_factor < MAXIMUM_FACTOR and switch_error(distance, cutoff, spacing) > accuracy:
            self._least_factor *= 2
            spacing /= 2
        self._switch_error = switch_error(distance, cutoff, spacing)
        # Points of a curve are at most half a spacing nearer to a target than `closeness` says.
        self._limits = cutoff / membranes.curve_spacing + 0.5
        self.reach = max(everywhere.reach, float(self._limits.max()))

    def refinement(self, closeness: Proximity) -> Refinement:
        """Return the groups of targets and sources; see `InteractionRange`.

        Parameters
        ----------
        closeness : Proximity

        Returns
        -------
        Refinement
        """
        refinement = closeness.refinement(self._everywhere.reach, self._limits)
        groups = refinement.groups.copy()
        groups[:, 2] = np.maximum(groups[:, 2], self._least_factor)
        points, largest = refinement.interpolations.shape[1], int(groups[:, 2].max(initial=1))
        return refinement._replace(groups=groups, interpolations=interpolations(points, largest))

    def sum_error(self, closeness: Proximity) -> float:
        """Return the relative error of the force; see `InteractionRange`.

        Parameters
        ----------
        closeness : Proximity

        Returns
        -------
        float
        """
        return max(self._everywhere.sum_error(closeness), self._switch_error)


class DirectAdhesion:
    """Adhesion summed over all pairs of points, of a few vesicles, or of many within a cutoff.

    Parameters
    ----------
    potential : PairPotential
    accuracy : float
        Relative error allowed in the force between two nearly parallel membranes.
    membranes : Membranes
    parallel : Parallel
        The points that the forces act on are shared out among these ranks.
    """

    def __init__(
        self,
        potential: PairPotential,
        accuracy: float,
        membranes: Membranes,
        parallel: Parallel = SERIAL,
    ) -> None:
        everywhere = Everywhere(potential.singularity, accuracy)
        self._range: InteractionRange = everywhere
        if potential.cutoff is not None:
            self._range = WithinCutoff(everywhere, potential.distance, potential.cutoff, accuracy, membranes)
        self._law = formula_and_parameters(potential)
        self._hamaker = potential.hamaker
        self._parallel = parallel

    @property
    def reach(self) -> float:
        """Distance over spacing within which targets of a source are looked for."""
        return self._range.reach

    def density(self, geometry: Geometry, closeness: Proximity) -> Array:
        """Compute the force per length.

        Collective.

        Parameters
        ----------
        geometry : Geometry
        closeness : Proximity
            Of this geometry, at least to `reach`.

        Returns
        -------
        (2, M, N)
        """
        density = np.zeros(geometry.points.shape)
        shares, sums = self._sums(geometry, closeness)
        add_density(*sums, self._hamaker, density)
        return gather_points(shares, density)

    def jacobian(self, geometry: Geometry, closeness: Proximity) -> Array:
        """Compute the derivative of `density` by the state.

        Collective.

        Parameters
        ----------
        geometry : Geometry
        closeness : Proximity
            As for `density`.

        Returns
        -------
        (2, M·N, state_size)
        """
        membranes = geometry.membranes
        size = membranes.count * membranes.points
        hessian = np.empty((2, size, 2, size))
        shares, sums = self._sums(geometry, closeness)
        fill_hessian(*sums, self._hamaker, hessian)
        own = hessian[:, shares.own]
        return shares.gather(geometry.by_state(own), axis=1)

    def stiffness(self, geometry: Geometry, closeness: Proximity) -> Array:
        """Compute the derivative of the density at each point by that point.

        Collective.

        Parameters
        ----------
        geometry : Geometry
        closeness : Proximity
            As for `density`.

        Returns
        -------
        (3, M, N)
            Its components xx, xy and yy.
        """
        stiffness = np.zeros((3, *geometry.points.shape[1:]))
        shares, sums = self._sums(geometry, closeness)
        add_stiffness(*sums, self._hamaker, stiffness)
        return gather_points(shares, stiffness)

    def energy(self, geometry: Geometry, closeness: Proximity) -> float:
        """Compute ½∫∫ φ ds ds over all pairs of vesicles, images included.

        Collective.

        Parameters
        ----------
        geometry : Geometry
        closeness : Proximity
            As for `density`.

        Returns
        -------
        float
        """
        _, sums = self._sums(geometry, closeness)
        return total_energy(self._parallel, geometry, self._hamaker * summed_energy(*sums))

    def sum_error(self, closeness: Proximity) -> float:
        """Compute the relative error of the force between the closest membranes, refined as far as it goes.

        Parameters
        ----------
        closeness : Proximity

        Returns
        -------
        float
        """
        return self._range.sum_error(closeness)

    def _sums(self, geometry: Geometry, closeness: Proximity) -> tuple[Shares, tuple[Any, ...]]:
        """How the points are shared out, and the arguments of this rank's compiled sums."""
        refinement = self._range.refinement(closeness)
        size = geometry.points[0].size

        def costs() -> Array:
            return sum_costs(refinement, refinement.groups[:, 2].astype(float), size)

        shares = self._parallel.divide(size, costs)
        own = within(refinement, shares.own, size)
        return shares, (geometry.curve_points, geometry.membranes.curve_spacing, own, *self._law)


def gather_points(shares: Shares, values: Array) -> Array:
    """Gather values at points of which every rank has computed those of its share.

    Collective.

    Parameters
    ----------
    shares : Shares
        Of the M·N points.
    values : (k, M, N)

    Returns
    -------
    (k, M, N)
    """
    own = values.reshape(len(values), -1)[:, shares.own]
    return shares.gather(own, axis=1).reshape(values.shape)


def total_energy(parallel: Parallel, geometry: Geometry, energy: float) -> float:
    """Sum the energies of all ranks' points and of their images.

    Collective.

    Parameters
    ----------
    parallel : Parallel
    geometry : Geometry
    energy : float
        Of this rank's points.

    Returns
    -------
    float
    """
    each = parallel.divide(parallel.size).gather(np.array([energy]))
    return float(geometry.membranes.multiplicity * each.sum())
