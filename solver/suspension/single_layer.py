"""The single-layer potential over many membranes, summed instead of stored; see `solver.stokes`.

All points act on all points by the trapezoid rule (`direct_sum`), which is right between vesicles that are
far apart.  What Kress's rule adds on a vesicle itself is the same circulant matrix for all.  For targets near
another vesicle the difference between a refined or close evaluation and the trapezoid rule is kept as small
blocks while the geometry stays.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.close_evaluation import close_stokeslets, logarithm_correction
from solver.compilation import compiled
from solver.direct_sum import velocity as direct_velocity
from solver.geometry import Geometry, Membranes
from solver.kernels import stokeslets
from solver.parallel import Parallel
from solver.proximity import Proximity
from solver.quadrature import required_ratio
from solver.refinement import LARGEST_REFINED, Refinement, interpolation_to, refined_points, within
from solver.spectral import differentiation
from solver.stokes import row_costs

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


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
    blocks: Array, targets: Indices, sources: Indices, point_forces: Array, first: int, velocity: Array
) -> None:
    """Add what blocks (rows, 3, n) make of forces on ``sources`` (rows,), vesicles, to ``targets`` (rows,).

    ``velocity`` (2, ·) begins with the point ``first``.
    """
    for row in range(blocks.shape[0]):
        xx, xy, yy = blocks[row, 0], blocks[row, 1], blocks[row, 2]
        force_x, force_y = point_forces[0, sources[row]], point_forces[1, sources[row]]
        x = 0.0
        y = 0.0
        for j in range(xx.size):
            x += xx[j] * force_x[j] + xy[j] * force_y[j]
            y += xy[j] * force_x[j] + yy[j] * force_y[j]
        velocity[0, targets[row] - first] += x
        velocity[1, targets[row] - first] += y


class SummedSingleLayer:
    """Discrete single-layer potential of many vesicles.

    Parameters
    ----------
    membranes : Membranes
        Without images.
    accuracy : float
        Relative error allowed in the velocity that one vesicle causes on another.
    parallel : Parallel
        The target points are shared out among these ranks.

    Attributes
    ----------
    ratio : float
        Distance over spacing below which a target is near.
    sums : int
        How many sums over all points have been made.
    """

    def __init__(self, membranes: Membranes, accuracy: float, parallel: Parallel) -> None:
        self.ratio = required_ratio(1.0, accuracy)
        self.sums = 0
        self._parallel = parallel
        self._correction = logarithm_correction(membranes.points)
        self._lengths = -np.log(membranes.length / (2 * np.pi))[:, None] / (4 * np.pi)

    def assemble(self, geometry: Geometry, neighbors: Proximity) -> None:
        """Make the blocks for this geometry."""
        membranes = geometry.membranes
        self._geometry = geometry
        self._points = geometry.points.reshape(2, -1)
        size = self._points.shape[1]
        refinement = neighbors.refinement(self.ratio)
        self._shares = self._parallel.divide(size, lambda: size + row_costs(refinement, size))
        own = self._shares.own
        refinement = within(refinement, own, size)
        group = np.repeat(np.arange(len(refinement.groups)), np.diff(refinement.starts))
        self._sources = refinement.groups[group, 1]
        self._targets = refinement.groups[group, 0] * membranes.points + refinement.rows
        self._blocks = np.empty((len(group), 3, membranes.points))
        _near_blocks(
            geometry.points,
            geometry.tangents,
            membranes.spacing,
            refinement,
            self._correction,
            differentiation(membranes.points),
            self._blocks,
        )
        self._own_points = np.ascontiguousarray(self._points[:, own])

    def velocity(self, point_forces: Array) -> Array:
        """Velocity (2, M, N) that point forces (2, M, N) cause at the membranes' points."""
        self.sums += 1
        forces = np.ascontiguousarray(point_forces)
        part = direct_velocity(self._own_points, self._points, forces.reshape(2, -1))
        _add_blocks(self._blocks, self._targets, self._sources, forces, self._shares.own.start, part)
        velocity = self._shares.gather(part, axis=1).reshape(forces.shape)
        velocity += forces @ self._correction
        velocity += self._lengths * forces
        tangents = self._geometry.tangents
        velocity += tangents * (np.sum(tangents * forces, axis=0) / (4 * np.pi))
        return velocity
