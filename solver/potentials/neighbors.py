"""Pairs of vesicles that are near each other, found in a time that grows like their number."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.membrane.products import multiply_both
from solver.membrane.spectral import interpolation, interpolations
from solver.potentials.refinement import MAXIMUM_FACTOR, Refinement, group_targets, selected_points
from solver.potentials.stokeslets import distances

if TYPE_CHECKING:
    from solver.membrane.geometry import Geometry

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@compiled
def _near_distances(
    points: Array,
    tangents: Array,
    spacing: Array,
    centers: Array,
    radii: Array,
    pairs: Indices,
    reach: Array,
    out: Array,
) -> None:
    """Write the `distances` (k, N) of the target's points to the source for each of ``pairs`` (k, 2).

    Infinite where the point is not within ``reach`` (k,) of the circle about the source.
    """
    rows = np.empty(points.shape[2], dtype=np.int64)
    for pair in range(pairs.shape[0]):
        target, source = pairs[pair, 0], pairs[pair, 1]
        limit = (radii[source] + reach[pair]) ** 2
        found = 0
        for i in range(rows.size):
            dx = points[0, target, i] - centers[0, source]
            dy = points[1, target, i] - centers[1, source]
            out[pair, i] = np.inf
            if dx * dx + dy * dy <= limit:
                rows[found] = i
                found += 1
        if found == 0:
            continue
        near, targets = np.empty(found), selected_points(points, target, rows[:found])
        distances(
            targets[0],
            targets[1],
            points[0, source],
            points[1, source],
            tangents[0, source],
            tangents[1, source],
            spacing[source],
            near,
        )
        for k in range(found):
            if near[k] <= reach[pair]:
                out[pair, rows[k]] = near[k]


class Neighbors:
    """Pairs of vesicles that are near each other.

    Parameters
    ----------
    geometry : Geometry
        Without images.
    reach : float
        How near, in spacings of the source.

    Attributes
    ----------
    pairs : (k, 2)
        Target and source; every pair is there both ways, where any target is within reach.
    distances : (k, N)
        Distance over the source's spacing of each point of the target, infinite beyond reach.
    nearest, smallest_distance : float
        The smallest of them, and the smallest distance; infinite if there is none.
    """

    def __init__(self, geometry: Geometry, reach: float) -> None:
        from scipy.spatial import cKDTree  # for the reason that `solver.membrane.shapes` gives

        membranes = geometry.membranes
        self._points, self._curves = membranes.points, membranes.count
        centers, radii = geometry.centers, geometry.radii
        allowed = reach * membranes.spacing
        # Between its points a curve is at most half a spacing nearer than they are.
        unordered = cKDTree(centers.T).query_pairs(
            2 * radii.max() + allowed.max() + membranes.spacing.max(), output_type="ndarray"
        )
        pairs = np.concatenate([unordered, unordered[:, ::-1]]).astype(np.int64)
        apart = np.linalg.norm(centers[:, pairs[:, 0]] - centers[:, pairs[:, 1]], axis=0)
        touching = apart <= radii[pairs].sum(axis=1) + allowed[pairs[:, 1]] + membranes.spacing.max()
        pairs = pairs[touching]
        # In an order that does not depend on how the tree was searched.
        pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
        values = np.empty((len(pairs), self._points))
        _near_distances(
            geometry.points,
            geometry.tangents,
            membranes.spacing,
            centers,
            radii + 0.5 * membranes.spacing,
            pairs,
            allowed[pairs[:, 1]],
            values,
        )
        near = np.isfinite(values).any(axis=1)
        self.pairs = pairs[near]
        self.smallest_distance = float(values.min(initial=np.inf))
        self.distances = values[near] / membranes.spacing[self.pairs[:, 1], None]
        self.nearest = float(self.distances.min(initial=np.inf))

    def refinement(self, ratio: float, limits: Array | None = None) -> Refinement:
        """Return the refinement, see `proximity.Proximity`.

        Parameters
        ----------
        ratio : float
            At most the reach.
        limits : (C,), optional
            At most the reach.  Without limits, targets that need no refinement are in no group.

        Returns
        -------
        Refinement
        """
        factor = 1
        while factor < MAXIMUM_FACTOR and factor * self.nearest < ratio:
            factor *= 2
        limits = np.full(self._curves, ratio) if limits is None else limits
        groups, rows, starts = group_targets(self.pairs, self.distances, ratio, limits)
        return Refinement(groups, rows, starts, interpolations(self._points, factor))


def gap(geometry: Geometry, refinement: int = 4) -> float:
    """Return the smallest distance between two different membranes.

    Parameters
    ----------
    geometry : Geometry
    refinement : int
        Factor by which the points of each membrane are interpolated first.

    Returns
    -------
    float
    """
    membranes = geometry.membranes
    if membranes.multiplicity == 1:
        return _gap_of_many(geometry, refinement)
    # One vesicle: only a pair that a half turn leaves as it is has an image.
    points, tangents = geometry.points[:, 0], geometry.tangents[:, 0]
    matrix = interpolation(membranes.points, refinement)
    return float(_gap_to_image(points, tangents, float(membranes.spacing[0]), matrix))


@compiled
def _gap_to_image(points: Array, tangents: Array, spacing: float, matrix: Array) -> float:
    """Compute `gap` of a vesicle (2, N) and its image, with the matrix of interpolation (refinement·N, N).

    The distance of a point to the image is that of the opposite point to the vesicle itself.
    """
    count, fine_count = points.shape[1], matrix.shape[0]
    refinement = fine_count // count
    fine, opposite, apart = np.empty((4, fine_count)), np.empty((2, fine_count)), np.empty(count)
    multiply_both(matrix, points[0], points[1], fine[0], fine[1])
    multiply_both(matrix, tangents[0], tangents[1], fine[2], fine[3])
    for i in range(count):
        opposite[0, i], opposite[1, i] = -points[0, i], -points[1, i]
    distances(opposite[0], opposite[1], points[0], points[1], tangents[0], tangents[1], spacing, apart)
    nearest = np.inf
    for i in range(count):
        nearest = min(nearest, apart[i])
    # Points that are interpolated are at most half a spacing from one that is not.
    found = 0
    for k in range(fine_count):
        if apart[(k + refinement // 2) // refinement % count] <= nearest + spacing:
            opposite[0, found], opposite[1, found] = -fine[0, k], -fine[1, k]
            found += 1
    gaps = np.empty(found)
    distances(opposite[0], opposite[1], fine[0], fine[1], fine[2], fine[3], spacing / refinement, gaps)
    gap = np.inf
    for k in range(found):
        gap = min(gap, gaps[k])
    return gap


def _gap_of_many(geometry: Geometry, refinement: int) -> float:
    """Compute `gap` of vesicles without images."""
    membranes = geometry.membranes
    reach = 2.0
    while not len((near := Neighbors(geometry, reach)).pairs):
        reach *= 2.0
    # Distances between points as they are differ by less than a spacing from those between more points.
    limit = near.smallest_distance + membranes.spacing.max()
    near = Neighbors(geometry, limit / membranes.spacing.min())
    matrix = interpolation(membranes.points, refinement).T
    gaps = np.empty((len(near.pairs), refinement * membranes.points))
    everywhere = np.full(len(near.pairs), np.inf)
    _near_distances(
        geometry.points @ matrix,
        geometry.tangents @ matrix,
        membranes.spacing / refinement,
        geometry.centers,
        np.full(membranes.count, np.inf),
        near.pairs,
        everywhere,
        gaps,
    )
    return float(gaps.min())
