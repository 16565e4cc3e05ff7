"""How close membranes are, and how finely they must be sampled for each other because of it."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from solver.membrane.spectral import interpolations
from solver.potentials.refinement import MAXIMUM_FACTOR, Refinement, group_targets
from solver.potentials.stokeslets import pair_distances, waists

if TYPE_CHECKING:
    from solver.membrane.geometry import Geometry

Array = NDArray[np.float64]


class Proximity(Protocol):
    """Which membranes are close to which: `Closeness`, or `neighbors.Neighbors` where there are many.

    Attributes
    ----------
    nearest : float
        Smallest distance of a point to another membrane, over the spacing of that one.
    """

    nearest: float

    def refinement(self, ratio: float, limits: Array | None = None) -> Refinement:
        """Return the refinement that brings every target to ``ratio`` refined spacings of every source.

        Parameters
        ----------
        ratio : float
            Distance over refined spacing.
        limits : (C,), optional
            Distance over spacing of each curve, within which targets are in a group of it.  Without limits
            all targets are that may need a sum of their own.

        Returns
        -------
        Refinement
        """


@cache
def all_pairs(count: int, curves: int) -> NDArray[np.int64]:
    """Return all pairs of a vesicle and a curve, itself among them.

    Parameters
    ----------
    count, curves : int

    Returns
    -------
    (count·curves, 2)
    """
    return np.argwhere(np.ones((count, curves)))


@cache
def _no_limits(curves: int) -> Array:
    """Return limits that leave out a curve itself only, which is at no finite distance."""
    return np.full(curves, np.inf)


@cache
def _nothing_refined(count: int, curves: int, points: int) -> Refinement:
    """Return the refinement with the factor 1 for all points and every other curve."""
    pairs = all_pairs(count, curves)
    groups = np.array([[target, source, 1] for target, source in pairs if target != source])
    rows, starts = np.tile(np.arange(points), len(groups)), points * np.arange(len(groups) + 1)
    return Refinement(groups, rows, starts, interpolations(points, 1))


class Closeness:
    """Distances between all membranes of a geometry.

    Parameters
    ----------
    geometry : Geometry

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
        self.distances = np.empty((membranes.count, membranes.curves, membranes.points))
        self.nearest: float = pair_distances(
            geometry.curve_points, geometry.curve_tangents, membranes.curve_spacing, self.distances
        )

    def refinement(self, ratio: float, limits: Array | None = None) -> Refinement:
        """Return the refinement, see `Proximity`.

        Parameters
        ----------
        ratio : float
        limits : (C,), optional
            Without limits every target is in a group of every other curve.

        Returns
        -------
        Refinement
        """
        factor = 1
        while factor < MAXIMUM_FACTOR and factor * self.nearest < ratio:
            factor *= 2
        count, curves, points = self.distances.shape
        if factor == 1 and limits is None:
            return _nothing_refined(count, curves, points)
        limits = _no_limits(curves) if limits is None else limits
        pairs = all_pairs(count, curves)
        groups, rows, starts = group_targets(pairs, self.distances.reshape(-1, points), ratio, limits)
        return Refinement(groups, rows, starts, interpolations(self._points, factor))


def waist_error(geometry: Geometry) -> Array:
    """Return the relative error of the single layer across each vesicle's own waist.

    There the trapezoid rule, with the logarithm of the neighborhood split off, has the error that it has on
    another membrane (`quadrature`), and nothing is refined.

    Parameters
    ----------
    geometry : Geometry

    Returns
    -------
    (M,)
    """
    waist = waists(geometry.points)
    return np.asarray(2 * np.exp(-2 * np.pi * waist / geometry.membranes.spacing))
