"""The single-layer potential over many membranes, summed instead of stored; see `solver.stokes`.

Points act on points by the trapezoid rule, which is right between vesicles that are far apart: directly, or
by the series of a vesicle where these serve (`multipoles`).  What Kress's rule adds on a vesicle itself is
the same circulant matrix for all.  For targets near another vesicle the difference between a refined or close
evaluation and the trapezoid rule is kept as small blocks while the geometry stays.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.close_evaluation import close_stokeslets, logarithm_correction
from solver.compilation import compiled
from solver.geometry import Geometry, Membranes
from solver.kernels import stokeslets
from solver.parallel import Parallel, Shares
from solver.proximity import Proximity
from solver.quadrature import required_ratio
from solver.refinement import LARGEST_REFINED, Refinement, interpolation_to, refined_points, within
from solver.spectral import differentiation
from solver.stokes import row_costs
from solver.suspension.multipoles import LARGEST_ORDER, coefficients_of, orders_between, powers_of
from solver.suspension.multipoles import velocity as summed_velocity

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_SERIES_COST = 3.0  # of a series to one target beyond its terms, in Stokeslets


@compiled
def _near_blocks(
    points: Array,
    tangents: Array,
    spacing: Array,
    refinement: Refinement,
    correction: Array,
    differentiation: Array,
    blocks: Array,
) -> None:
    """Write what the trapezoid rule lacks for near targets, components (rows, 3, n) row by row."""
    n = points.shape[2]
    for g in range(refinement.groups.shape[0]):
        target, source, factor = refinement.groups[g]
        first, last = refinement.starts[g], refinement.starts[g + 1]
        targets = points[:, target][:, refinement.rows[first:last]]
        coarse = np.ascontiguousarray(points[:, source])
        plain, better = np.empty((3, last - first, n)), np.empty((3, last - first, n))
        stokeslets(targets, coarse, plain)
        if factor > LARGEST_REFINED:
            close_stokeslets(
                targets,
                coarse,
                np.ascontiguousarray(tangents[:, source]),
                spacing[source],
                correction,
                differentiation,
                better,
            )
        else:
            fine = refined_points(points, source, factor, refinement)
            refined = np.empty((3, last - first, fine.shape[1]))
            stokeslets(targets, fine, refined)
            folding = interpolation_to(refinement, factor)
            for component in range(3):
                better[component] = np.dot(refined[component], folding) / factor
        for row in range(first, last):
            for component in range(3):
                for j in range(n):
                    blocks[row, component, j] = (
                        better[component, row - first, j] - plain[component, row - first, j]
                    )


@compiled
def _add_blocks(
    blocks: Array, targets: Indices, sources: Indices, point_forces: Array, velocity: Array
) -> None:
    """Add to ``velocity`` (2, m, n) what blocks (rows, 3, n) make of forces (M, 2, n).

    targets : (2, rows), vesicles and points on them; sources : (rows,), vesicles
    """
    for row in range(blocks.shape[0]):
        xx, xy, yy = blocks[row, 0], blocks[row, 1], blocks[row, 2]
        force_x, force_y = point_forces[sources[row], 0], point_forces[sources[row], 1]
        x = 0.0
        y = 0.0
        for j in range(xx.size):
            x += xx[j] * force_x[j] + xy[j] * force_y[j]
            y += xy[j] * force_x[j] + yy[j] * force_y[j]
        velocity[0, targets[0, row], targets[1, row]] += x
        velocity[1, targets[0, row], targets[1, row]] += y


class SummedSingleLayer:
    """Discrete single-layer potential of many vesicles.

    Parameters
    ----------
    membranes : Membranes
        Without images.
    accuracy : float
        Relative error allowed in the velocity that one vesicle causes on another.
    parallel : Parallel
        The vesicles that velocities are asked for are shared out among these ranks.

    Attributes
    ----------
    ratio : float
        Distance over spacing below which a target is near.
    shares : Shares
        Of the vesicles, in the last geometry assembled.
    """

    shares: Shares

    def __init__(self, membranes: Membranes, accuracy: float, parallel: Parallel) -> None:
        self.ratio = required_ratio(1.0, accuracy)
        self._accuracy = accuracy
        self._parallel = parallel
        self._correction = logarithm_correction(membranes.points)
        self._lengths = -np.log(membranes.length / (2 * np.pi))[:, None] / (4 * np.pi)

    def assemble(self, geometry: Geometry, neighbors: Proximity) -> None:
        """Make the blocks and the powers for this geometry."""
        membranes = geometry.membranes
        count, points = membranes.count, membranes.points
        refinement = neighbors.refinement(self.ratio)
        orders = np.empty((count, count), dtype=np.int64)
        orders_between(geometry.points, geometry.centers, self._accuracy, orders)

        def costs() -> Array:
            near = row_costs(refinement, count * points).reshape(count, points).sum(axis=1)
            each = np.where(orders > 0, _SERIES_COST + orders, points)
            return near + points * each.sum(axis=1)

        self.shares = self._parallel.divide(count, costs)
        own = self.shares.own
        self._geometry = geometry
        self._powers = powers_of(geometry, own)
        self._orders = orders[own]
        refinement = within(refinement, slice(own.start * points, own.stop * points), count * points)
        group = np.repeat(np.arange(len(refinement.groups)), np.diff(refinement.starts))
        self._sources = refinement.groups[group, 1]
        self._targets = np.stack([refinement.groups[group, 0] - own.start, refinement.rows])
        self._blocks = np.empty((len(group), 3, points))
        _near_blocks(
            geometry.points,
            geometry.tangents,
            membranes.spacing,
            refinement,
            self._correction,
            differentiation(points),
            self._blocks,
        )

    def velocity(self, own_forces: Array) -> Array:
        """Velocity (2, m, N) of this rank's m vesicles, from the point forces (2, m, N) on them.

        Collective.
        """
        geometry, own = self._geometry, self.shares.own
        _, count, points = own_forces.shape
        sent = np.empty((count, 2 * points + 6 * (LARGEST_ORDER + 1)))
        sent[:, : 2 * points].reshape(count, 2, points)[:] = own_forces.swapaxes(0, 1)
        sent[:, 2 * points :] = coefficients_of(self._powers, own_forces).reshape(count, -1)
        everyone = self.shares.gather(sent)
        forces = np.ascontiguousarray(everyone[:, : 2 * points]).reshape(-1, 2, points)
        coefficients = np.ascontiguousarray(everyone[:, 2 * points :]).reshape(-1, 6, LARGEST_ORDER + 1)
        velocity = np.empty_like(own_forces)
        summed_velocity(
            geometry.points, forces, geometry.centers, coefficients, self._orders, own.start, velocity
        )
        _add_blocks(self._blocks, self._targets, self._sources, forces, velocity)
        velocity += own_forces @ self._correction
        velocity += self._lengths[own] * own_forces
        tangents = geometry.tangents[:, own]
        velocity += tangents * (np.sum(tangents * own_forces, axis=0) / (4 * np.pi))
        return velocity
