"""Which membrane points are so close to another vesicle that its points must be refined for them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.geometry import Geometry
from solver.kernels import pair_distances
from solver.quadrature import refinement_factors
from solver.spectral import interpolation

Array = NDArray[np.float64]


class Refinement(NamedTuple):
    """Points of one vesicle for which another is interpolated to ``factor`` times as many points."""

    factor: int
    rows: NDArray[np.int64]  # of the target's points
    targets: Array  # (2, rows)
    sources: Array  # (2, factor·N)
    interpolation: Array  # (factor·N, N)


class Closeness:
    """Distances between all membranes of a geometry, and what they ask of the quadrature."""

    def __init__(self, geometry: Geometry) -> None:
        self._geometry = geometry
        self._sources: dict[tuple[int, int], Array] = {}

    @cached_property
    def _distances(self) -> Array:
        """Of every point to every other membrane over its spacing, (target, source, N)."""
        membranes = self._geometry.membranes
        distance = np.full((membranes.count, membranes.count, membranes.points), np.inf)
        pair_distances(self._geometry.points, self._geometry.tangents, membranes.spacing, distance)
        distance /= membranes.spacing[:, None]
        return distance

    @cached_property
    def _nearest(self) -> Array:
        """Least of the distances, (target, source)."""
        return self._distances.min(axis=-1)

    def refinements(self, target: int, source: int, ratio: float) -> Iterator[Refinement]:
        """Refinements with which no target point is nearer than ``ratio`` spacings of the source."""
        if self._nearest[target, source] >= ratio:
            return
        factors = refinement_factors(self._distances[target, source], ratio)
        points = self._geometry.membranes.points
        for factor in set(factors.tolist()) - {1}:
            rows = np.flatnonzero(factors == factor)
            yield Refinement(
                factor,
                rows,
                self._geometry.points[:, target, rows],
                self._fine_points(source, factor),
                interpolation(points, factor),
            )

    def _fine_points(self, vesicle: int, factor: int) -> Array:
        if (vesicle, factor) not in self._sources:
            matrix = interpolation(self._geometry.membranes.points, factor)
            self._sources[vesicle, factor] = self._geometry.points[:, vesicle] @ matrix.T
        return self._sources[vesicle, factor]


def gap(geometry: Geometry, refinement: int = 4) -> float:
    """Smallest distance between two different membranes, seen at ``refinement`` times as many points."""
    membranes = geometry.membranes
    matrix = interpolation(membranes.points, refinement).T
    distance = np.full((membranes.count, membranes.count, refinement * membranes.points), np.inf)
    pair_distances(
        geometry.points @ matrix, geometry.tangents @ matrix, membranes.spacing / refinement, distance
    )
    return float(distance.min())
