"""How close membranes are, and how finely they must be sampled for each other because of it."""

from __future__ import annotations

from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from solver.membrane.geometry import Geometry
from solver.membrane.spectral import interpolation, interpolations
from solver.potentials.neighbors import smallest_gap
from solver.potentials.refinement import MAXIMUM_FACTOR, Refinement, group_targets
from solver.potentials.stokeslets import pair_distances, waists

Array = NDArray[np.float64]


class Proximity(Protocol):
    """Which membranes are close to which: `Closeness`, or `neighbors.Neighbors` where there are many."""

    nearest: float  # distance over spacing

    def refinement(self, ratio: float, limits: Array | None = None) -> Refinement:
        """The refinement that brings every target to ``ratio`` spacings of every source.

        ``limits`` (C,) are the distances over spacing of each curve within which targets are in it; without,
        all are that are known to need a sum of their own.
        """


@cache
def all_pairs(count: int, curves: int) -> NDArray[np.int64]:
    """All pairs (count·curves, 2) of a vesicle and a curve, itself among them."""
    return np.argwhere(np.ones((count, curves)))


class Closeness:
    """Distances between all membranes of a geometry.

    Attributes
    ----------
    distances : (M, C, N)
        Distance over the source's spacing, by target, source and point of the target.
    nearest : float
        The smallest of them.
    """

    def __init__(self, geometry: Geometry) -> None:
        membranes = geometry.membranes
        self._points = membranes.points
        spacing = membranes.curve_spacing
        self.distances = pair_distances(
            geometry.curve_points, geometry.curve_tangents, spacing, membranes.count
        )
        self.distances /= spacing[:, None]
        self.nearest = float(self.distances.min())

    def refinement(self, ratio: float, limits: Array | None = None) -> Refinement:
        """See `Proximity`.  Without limits every target is in a group of every other curve."""
        factor = 1
        while factor < MAXIMUM_FACTOR and factor * self.nearest < ratio:
            factor *= 2
        count, curves, points = self.distances.shape
        # No curve is at a finite distance from itself.
        limits = np.full(curves, np.inf) if limits is None else limits
        pairs = all_pairs(count, curves)
        groups, rows, starts = group_targets(pairs, self.distances.reshape(-1, points), ratio, limits)
        return Refinement(groups, rows, starts, interpolations(self._points, factor))


def waist_error(geometry: Geometry) -> Array:
    """Relative error (M,) of the single layer across each vesicle's own waist.

    There the trapezoid rule, with the logarithm of the neighborhood split off, errs as on another membrane
    (`quadrature`), and nothing is refined.
    """
    waist = waists(geometry.points)
    return np.asarray(2 * np.exp(-2 * np.pi * waist / geometry.membranes.spacing))


def gap(geometry: Geometry, refinement: int = 4) -> float:
    """Smallest distance between two different membranes, seen at ``refinement`` times as many points."""
    membranes = geometry.membranes
    if membranes.copies == 1:
        return smallest_gap(geometry, refinement)
    matrix = interpolation(membranes.points, refinement).T
    distances = pair_distances(
        geometry.curve_points @ matrix,
        geometry.curve_tangents @ matrix,
        membranes.curve_spacing / refinement,
        membranes.count,
    )
    return float(distances.min())
