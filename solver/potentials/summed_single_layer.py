"""The single-layer potential over many membranes, summed instead of stored.

See `solver.potentials.single_layer` for its definition.

Points act on points by the trapezoid rule, which is accurate between vesicles that are far apart: directly,
or by series in the moments of a vesicle (`multipoles`).  The rule of Kress (2014) adds the same circulant
matrix on every vesicle.  For targets near another vesicle the difference between a refined or close
evaluation and the trapezoid rule is kept in small blocks as long as the geometry stays.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.membrane.spectral import differentiation
from solver.potentials.close_evaluation import close_stokeslets, logarithm_correction
from solver.potentials.multipoles import LARGEST_ORDER, orders_between, write_coefficients
from solver.potentials.multipoles import velocity as summed_velocity
from solver.potentials.quadrature import required_ratio
from solver.potentials.refinement import LARGEST_REFINED, Refinement, interpolation_to, refined_points, within
from solver.potentials.single_layer import row_costs
from solver.potentials.stokeslets import stokeslets

if TYPE_CHECKING:
    from solver.membrane.geometry import Geometry, Membranes
    from solver.parallel import Parallel, Shares
    from solver.potentials.proximity import Proximity

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Measured, in Stokeslets: the cost of a series at one target and of each of its terms.  And how many
# velocities are asked for after an assembly.
_SERIES_COST = 2.8
_TERM_COST = 0.3
_VELOCITIES = 8


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
    """Write what the trapezoid rule misses at near targets, components (rows, 3, n) row by row."""
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
    """Add to ``velocity`` (2, m, n) the products of blocks (rows, 3, n) and forces (M, 2, n).

    ``targets`` (2, rows) are vesicles and points on them, ``sources`` (rows,) vesicles.
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


@compiled
def _add_own(tangents: Array, lengths: Array, first: int, point_forces: Array, velocity: Array) -> None:
    """Add the velocity that point forces (2, m, n) on m vesicles from ``first`` on cause at their own points.

    That is the limit t⊗t of r⊗r/r², and a multiple of the force that depends on the vesicle's length.
    """
    scale = 1.0 / (4.0 * np.pi)
    for row in range(velocity.shape[1]):
        length = lengths[first + row]
        for i in range(velocity.shape[2]):
            tx, ty = tangents[0, first + row, i], tangents[1, first + row, i]
            fx, fy = point_forces[0, row, i], point_forces[1, row, i]
            along = scale * (tx * fx + ty * fy)
            velocity[0, row, i] += length * fx + along * tx
            velocity[1, row, i] += length * fy + along * ty


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
        self._lengths = -np.log(membranes.length / (2 * np.pi)) / (4 * np.pi)

    def assemble(self, geometry: Geometry, neighbors: Proximity) -> None:
        """Prepare velocities for a geometry.

        Parameters
        ----------
        geometry : Geometry
            Without images.
        neighbors : Proximity
        """
        membranes = geometry.membranes
        count, points = membranes.count, membranes.points
        refinement = neighbors.refinement(self.ratio)
        orders = np.empty((count, count), dtype=np.int64)
        orders_between(geometry.points, geometry.centers, geometry.radii, self._accuracy, orders)

        def costs() -> Array:
            near = row_costs(refinement, count * points).reshape(count, points).sum(axis=1)
            each = np.where(orders > 0, _SERIES_COST + _TERM_COST * orders, points)
            return near + _VELOCITIES * points * each.sum(axis=1)

        self.shares = self._parallel.divide(count, costs)
        own = self.shares.own
        self._geometry = geometry
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
        """Return the velocity of this rank's m vesicles.

        Collective.

        Parameters
        ----------
        own_forces : (2, m, N)
            Point forces on these vesicles.

        Returns
        -------
        (2, m, N)
        """
        geometry, own = self._geometry, self.shares.own
        _, count, points = own_forces.shape
        sent = np.empty((count, 2 * points + 6 * (LARGEST_ORDER + 1)))
        forces, coefficients = _parts(sent, points)
        forces[:] = own_forces.swapaxes(0, 1)
        write_coefficients(geometry.points, geometry.centers, own.start, own_forces, coefficients)
        forces, coefficients = map(np.ascontiguousarray, _parts(self.shares.gather(sent), points))
        velocity = own_forces @ self._correction
        summed_velocity(
            geometry.points, forces, geometry.centers, coefficients, self._orders, own.start, velocity
        )
        _add_blocks(self._blocks, self._targets, self._sources, forces, velocity)
        _add_own(geometry.tangents, self._lengths, own.start, own_forces, velocity)
        return velocity


def _parts(rows: Array, points: int) -> tuple[Array, Array]:
    """Return views of what ranks exchange about m vesicles: point forces and coefficients of series."""
    forces, coefficients = rows[:, : 2 * points], rows[:, 2 * points :]
    return forces.reshape(-1, 2, points), coefficients.reshape(-1, 6, LARGEST_ORDER + 1)
