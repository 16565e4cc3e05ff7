"""Which membrane points are so close to another vesicle that its points must be refined for them."""

from __future__ import annotations

from itertools import permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver import kernels
from solver.geometry import Geometry
from solver.quadrature import refinement_factors
from solver.spectral import interpolation

Array = NDArray[np.float64]


class Refinement(NamedTuple):
    """Points of one vesicle for which another is interpolated to ``factor`` times as many points."""

    target: int
    source: int
    factor: int
    rows: NDArray[np.int64]  # of the target's points
    targets: Array  # (2, rows)
    sources: Array  # (2, factor·N)
    interpolation: Array  # (factor·N, N)


class Proximity:
    """Finds the refinements of a geometry.

    Parameters
    ----------
    ratio : float
        Distance over spacing from which on no refinement is needed (`quadrature.required_ratio`).
    """

    def __init__(self, ratio: float) -> None:
        self.ratio = ratio

    def refinements(self, geometry: Geometry) -> list[Refinement]:
        """All refinements, ordered pair by ordered pair."""
        points, tangents = geometry.points, geometry.tangents
        spacing = geometry.membranes.spacing
        found = []
        distance = np.empty(geometry.membranes.points)
        for target, source in permutations(range(geometry.membranes.count), 2):
            sources = np.ascontiguousarray(points[:, source])
            targets = np.ascontiguousarray(points[:, target])
            kernels.distances(
                targets, sources, np.ascontiguousarray(tangents[:, source]), spacing[source], distance
            )
            if distance.min() >= self.ratio * spacing[source]:
                continue
            factors = refinement_factors(distance / spacing[source], self.ratio)
            for factor in np.unique(factors[factors > 1]):
                rows = np.flatnonzero(factors == factor)
                matrix = interpolation(geometry.membranes.points, int(factor))
                found.append(
                    Refinement(
                        target, source, int(factor), rows, targets[:, rows], sources @ matrix.T, matrix
                    )
                )
        return found


def gap(geometry: Geometry, refinement: int = 4) -> float:
    """Smallest distance between two different membranes."""
    smallest = np.inf
    points = geometry.membranes.points
    matrix = interpolation(points, refinement)
    fine_points = geometry.points @ matrix.T
    fine_tangents = geometry.tangents @ matrix.T
    distance = np.empty(points * refinement)
    for target, source in permutations(range(geometry.membranes.count), 2):
        kernels.distances(
            np.ascontiguousarray(fine_points[:, target]),
            np.ascontiguousarray(fine_points[:, source]),
            np.ascontiguousarray(fine_tangents[:, source]),
            geometry.membranes.spacing[source] / refinement,
            distance,
        )
        smallest = min(smallest, float(distance.min()))
    return smallest


