"""The single-layer potential over many membranes, summed instead of stored.

See `solver.potentials.single_layer` for its definition.

Points act on points by the trapezoid rule, which is accurate between vesicles that are far apart: directly,
or by series in the moments of a group of vesicles (`multipoles`).  The rule of Kress (2014) adds the same
circulant matrix on every vesicle.  For targets near another vesicle the difference between a refined or close
evaluation and the trapezoid rule is kept in small blocks as long as the geometry stays.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.membrane.spectral import differentiation
from solver.potentials.close_evaluation import close_stokeslets, logarithm_correction
from solver.potentials.direct_sum import add_near_velocities
from solver.potentials.multipoles import (
    LARGEST_OF_GROUP,
    LARGEST_ORDER,
    add_series,
    add_velocities,
    group_moments,
    write_moments,
)
from solver.potentials.quadrature import required_ratio
from solver.potentials.refinement import (
    LARGEST_REFINED,
    Refinement,
    interpolation_to,
    refined_points,
    selected_points,
    within,
)
from solver.potentials.single_layer import row_costs
from solver.potentials.stokeslets import stokeslets
from solver.potentials.vesicle_tree import FarNodes, interactions, vesicle_tree

if TYPE_CHECKING:
    from solver.membrane.geometry import Geometry, Membranes
    from solver.parallel import Parallel, Shares
    from solver.potentials.proximity import Proximity

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Measured: the usual cost of a vesicle's velocity without blocks, in Stokeslets, and how many velocities are
# asked for after an assembly.
_VESICLE_COST = 3e4
_VELOCITIES = 8

_ALIKE = 4  # source orders that are summed together; measured


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
    groups = refinement.groups
    for g in range(groups.shape[0]):
        target, source, factor = groups[g, 0], groups[g, 1], groups[g, 2]
        first, last = refinement.starts[g], refinement.starts[g + 1]
        targets = selected_points(points, target, refinement.rows[first:last])
        coarse = refined_points(points, source, 1, refinement)
        plain, better = np.empty((3, last - first, n)), np.empty((3, last - first, n))
        stokeslets(targets, coarse, plain)
        if factor > LARGEST_REFINED:
            close_stokeslets(
                targets,
                coarse,
                refined_points(tangents, source, 1, refinement),
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
                folded = np.dot(refined[component], folding)
                for row in range(last - first):
                    for j in range(n):
                        better[component, row, j] = folded[row, j] / factor
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
        tree = vesicle_tree(geometry.centers, geometry.radii)

        def costs() -> Array:
            blocks = row_costs(refinement, count * points).reshape(count, points).sum(axis=1)
            return blocks + _VELOCITIES * _VESICLE_COST

        self.shares = self._parallel.divide(count, costs)
        own = self.shares.own
        far, self._near = interactions(
            tree, self._accuracy, LARGEST_ORDER, LARGEST_OF_GROUP, own.start, own.stop
        )
        alike = np.lexsort((far.target_orders, far.source_orders // _ALIKE))
        self._far = FarNodes(*(part[alike] for part in far))
        self._geometry = geometry
        self._tree = tree
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
        geometry, tree, first = self._geometry, self._tree, self.shares.own.start
        circles = geometry.points, geometry.centers, geometry.radii, first
        own_moments = np.empty((own_forces.shape[1], 4, LARGEST_ORDER + 1))
        write_moments(*circles, own_forces, own_moments)
        moments = self.shares.gather(own_moments)
        forces = self.shares.gather(np.ascontiguousarray(own_forces.swapaxes(0, 1)))
        velocity = own_forces @ self._correction
        series, orders = np.zeros_like(own_moments), np.zeros(len(own_moments), dtype=np.int64)
        of_groups = group_moments(tree, moments, LARGEST_OF_GROUP)
        add_series(tree, self._far, first, moments, of_groups, series, orders)
        add_velocities(*circles, series, orders, velocity)
        add_near_velocities(geometry.points, forces, self._near, first, velocity)
        _add_blocks(self._blocks, self._targets, self._sources, forces, velocity)
        _add_own(geometry.tangents, self._lengths, first, own_forces, velocity)
        return velocity
