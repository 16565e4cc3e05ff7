"""The single-layer potential of Stokes flow over all membranes, kept as a matrix.

It is S f(x) = 1/(4π) ∫ (−log r I + r⊗r/r²) f ds with r = x − y and viscosity 1 (Quaife et al. 2019, appendix
"Integral Equation Formulation").  On its own vesicle the logarithm is split (Kress 2014): ½ log(4 sin²) is
integrated exactly.  On another vesicle the trapezoid rule is used, on refined sources where the target is
close (`refinement`), and Cauchy sums where it is very close (`close_evaluation`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.membrane.spectral import differentiation
from solver.parallel import SERIAL, Parallel
from solver.potentials import stokeslets
from solver.potentials.close_evaluation import close_single_layer, logarithm_correction, refine_single_layer
from solver.potentials.quadrature import required_ratio
from solver.potentials.refinement import LARGEST_REFINED, Refinement, sum_costs, within

if TYPE_CHECKING:
    from solver.membrane.geometry import Geometry, Membranes
    from solver.potentials.proximity import Closeness

Array = NDArray[np.float64]

# What one close target costs more than a far one, in Stokeslets a point of its source; measured.
_CLOSE_COST = 24.0


def row_costs(refinement: Refinement, size: int) -> Array:
    """Return what the row of each point costs beyond that of a far target.

    Parameters
    ----------
    refinement : Refinement
    size : int
        Number of points.

    Returns
    -------
    (size,)
        In Stokeslets.
    """
    factors = refinement.groups[:, 2]
    points = refinement.interpolations.shape[1]
    each = np.where(factors > LARGEST_REFINED, _CLOSE_COST, np.where(factors > 1, 2.0 * factors, 0.0))
    return sum_costs(refinement, each * points, size)


class SingleLayer:
    """Discrete single-layer potential, kept as a matrix.

    It acts on point forces, which are force densities times the spacing, and is symmetric up to quadrature
    error.  Images (`solver.membrane.symmetry`) carry the opposite forces.

    Parameters
    ----------
    membranes : Membranes
    accuracy : float
        Relative error allowed in the velocity that one vesicle causes on another.
    parallel : Parallel
        The rows are shared out among these ranks.

    Attributes
    ----------
    matrix : (2·M·N, 2·M·N)
        From all x-components of point forces and then all y-components, to the velocity's; filled by
        `assemble`.
    """

    def __init__(self, membranes: Membranes, accuracy: float, parallel: Parallel = SERIAL) -> None:
        self._ratio = required_ratio(1.0, accuracy)
        points = membranes.points
        size = membranes.count * points
        self._parallel = parallel
        self._buffer = np.zeros(3 * size * membranes.multiplicity * size)
        self.matrix = np.zeros((2 * size, 2 * size))
        self._correction = logarithm_correction(points)
        self._diagonal = self._correction[0, 0] - np.log(membranes.length / (2 * np.pi)) / (4 * np.pi)

    def assemble(self, geometry: Geometry, closeness: Closeness | None) -> None:
        """Fill the matrix for a geometry.

        Parameters
        ----------
        geometry : Geometry
        closeness : Closeness or None
            None for a single curve.
        """
        membranes = geometry.membranes
        size, sources = membranes.count * membranes.points, membranes.curves * membranes.points
        refinement = closeness.refinement(self._ratio) if closeness else None

        def costs() -> Array:
            return sources + (row_costs(refinement, size) if refinement else np.zeros(size))

        shares = self._parallel.divide(size, costs)
        own, rows = shares.own, shares.own.stop - shares.own.start
        components = self._buffer[: 3 * rows * sources].reshape(3, rows, sources)
        stokeslets.stokeslets(
            np.ascontiguousarray(geometry.points.reshape(2, -1)[:, own]),
            geometry.curve_points.reshape(2, -1),
            components,
        )
        stokeslets.complete_self_parts(
            self._correction, self._diagonal, geometry.tangents, components, own.start
        )
        if refinement and refinement.largest_factor > 1:
            refinement = within(refinement, own, size)
            refine_single_layer(geometry.curve_points, refinement, components, own.start)
            if refinement.largest_factor > LARGEST_REFINED:
                close_single_layer(
                    geometry.curve_points,
                    geometry.curve_tangents,
                    membranes.curve_spacing,
                    refinement,
                    self._correction,
                    differentiation(membranes.points),
                    components,
                    own.start,
                )
        stokeslets.join_components(shares.gather(components, axis=1), self.matrix)

    def velocity(self, point_forces: Array) -> Array:
        """Return the velocity that point forces cause at the membranes' points.

        Parameters
        ----------
        point_forces : (2, M, N)

        Returns
        -------
        (2, M, N)
        """
        return (self.matrix @ point_forces.ravel()).reshape(point_forces.shape)

    def columns(self, point_forces: Array) -> Array:
        """Return the velocities that several point forces cause, all at once.

        Parameters
        ----------
        point_forces : (2, M·N, columns)

        Returns
        -------
        (2, M·N, columns)
        """
        _, size, columns = point_forces.shape
        return (self.matrix @ point_forces.reshape(2 * size, columns)).reshape(2, size, columns)

    def jacobian(self, geometry: Geometry, point_forces: Array) -> Array:
        """Return the derivatives of `velocity` by the state at fixed point forces.

        Sources that are refined for close targets are differentiated as if they were not.

        Parameters
        ----------
        geometry : Geometry
        point_forces : (2, M, N)

        Returns
        -------
        (2, M·N, state_size)
        """
        membranes = geometry.membranes
        size = membranes.count * membranes.points
        shares = self._parallel.divide(size)
        own = shares.own
        by_points = np.empty((2, own.stop - own.start, 2, size))
        curve_forces = membranes.with_images(point_forces, axis=1).reshape(2, -1)
        stokeslets.stokeslet_derivatives(
            geometry.curve_points.reshape(2, -1), curve_forces, by_points, own.start
        )
        by_state = shares.gather(geometry.by_state(by_points), axis=1)
        stokeslets.add_tangent_rotation(geometry.tangents, point_forces, by_state)
        return by_state
