"""The single-layer potential of Stokes flow over all membranes (paper, appendix A):

S f(x) = 1/(4π) ∫ (−log r I + r⊗r/r²) f ds,  r = x − y  (viscosity 1).

On its own vesicle the logarithm is split after Kress, ½ log(4 sin²) being integrated exactly; on another
vesicle the trapezoid rule is used, on refined sources where the target is close (`refinement`), and Cauchy
sums where it is very close (`close_evaluation`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.membrane.geometry import Geometry, Membranes
from solver.membrane.spectral import differentiation
from solver.parallel import SERIAL, Parallel
from solver.potentials import stokeslets
from solver.potentials.close_evaluation import close_single_layer, logarithm_correction
from solver.potentials.proximity import Closeness
from solver.potentials.quadrature import required_ratio
from solver.potentials.refinement import LARGEST_REFINED, Refinement, refine_single_layer, sum_costs, within

Array = NDArray[np.float64]

# What one close target costs more than a far one, in Stokeslets a point of its source; measured.
_CLOSE_COST = 24.0


def row_costs(refinement: Refinement, size: int) -> Array:
    """Costs (size,) of the points' rows beyond those of far targets, in Stokeslets."""
    factors = refinement.groups[:, 2]
    points = refinement.interpolations.shape[1]
    each = np.where(factors > LARGEST_REFINED, _CLOSE_COST, np.where(factors > 1, 2.0 * factors, 0.0))
    return sum_costs(refinement, each * points, size)


class SingleLayer:
    """Discrete single-layer potential, kept as a matrix.

    It acts on point forces, that is force densities times the spacing, and is then symmetric up to
    quadrature error.  Images (`symmetry`) carry the opposite forces.

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
        self._buffer = np.zeros(3 * size * membranes.copies * size)
        self.matrix = np.zeros((2 * size, 2 * size))
        self._correction = logarithm_correction(points)
        self._diagonal = self._correction[0, 0] - np.log(membranes.length / (2 * np.pi)) / (4 * np.pi)

    def assemble(self, geometry: Geometry, closeness: Closeness | None) -> None:
        """Fill the matrix for this geometry; ``closeness`` is None for a single curve."""
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
        if refinement:
            refinement = within(refinement, own, size)
            refine_single_layer(geometry.curve_points, refinement, components, own.start)
            if refinement.groups[:, 2].max(initial=1) > LARGEST_REFINED:
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
        """Velocity (2, M, N) that point forces (2, M, N) cause at the membranes' points."""
        return (self.matrix @ point_forces.ravel()).reshape(point_forces.shape)

    def columns(self, point_forces: Array) -> Array:
        """Velocities (2, M·N, columns) for several point forces (2, M·N, columns) at once."""
        _, size, columns = point_forces.shape
        return (self.matrix @ point_forces.reshape(2 * size, columns)).reshape(2, size, columns)

    def jacobian(self, geometry: Geometry, point_forces: Array) -> Array:
        """Derivatives of `velocity` by the state, (2, M·N, state_size), at fixed point forces (2, M, N).

        Sources that are refined for close targets are differentiated as if they were not.
        """
        membranes = geometry.membranes
        size = membranes.count * membranes.points
        shares = self._parallel.divide(size)
        own = shares.own
        by_points = np.empty((2, own.stop - own.start, 2, membranes.copies * size))
        curve_forces = membranes.with_images(point_forces, axis=1).reshape(2, -1)
        stokeslets.stokeslet_derivatives(
            geometry.curve_points.reshape(2, -1), curve_forces, by_points, own.start
        )
        by_state = shares.gather(geometry.by_state(membranes.fold(by_points)), axis=1)
        forces = point_forces.reshape(2, -1)
        # On the diagonal r⊗r/r² is t⊗t, which turns with the tangent.
        tangents, normals = geometry.tangents.reshape(2, -1), geometry.normals.reshape(2, -1)
        along, across = np.sum(tangents * forces, axis=0), np.sum(normals * forces, axis=0)
        turned = (normals * along + tangents * across) / (4 * np.pi)
        every_point = np.arange(size)
        by_state[:, every_point, every_point] += turned
        return by_state
