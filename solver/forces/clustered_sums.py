"""Sums of a pair potential over all other vesicles, most of them by the few points that stand for them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.forces.clustered_sources import (
    Clusters,
    SourceLists,
    chebyshev_points,
    interpolate,
    write_sources,
)
from solver.forces.pair_sums import add_forces, add_stiffnesses, pair_energy

if TYPE_CHECKING:
    from solver.forces.pair_formulas import PairFormula

Array = NDArray[np.float64]


class _Sources(NamedTuple):
    """Points (2, k), and the arclength (k,) that each stands for."""

    points: Array
    weights: Array


@compiled
def add_clustered_density(
    formula: PairFormula,
    parameters: Any,
    clusters: Clusters,
    points: Array,
    spacing: Array,
    first: int,
    last: int,
    hamaker: float,
    density: Array,
) -> None:
    """Add the force per length of all other vesicles at some points.

    Parameters
    ----------
    formula : PairFormula
    parameters : tuple
        Of `formula_and_parameters`.
    clusters : Clusters
    points : (2, M, N)
    spacing : (M,)
    first, last : int
        The range of points, counted through all vesicles.
    hamaker : float
    density : (2, M, N)
        Added to.
    """
    lists, n = _lists(clusters, points), points.shape[2]
    for vesicle in range(first // n, -(-last // n)):
        targets = _rows(points, vesicle, first, last)
        grid = chebyshev_points(clusters.tree, vesicle, clusters.nodes)
        near, far = _acting(formula, parameters, clusters, points, spacing, vesicle, lists)
        out, values = np.zeros((2, targets.shape[1])), np.zeros((2, grid.shape[1]))
        add_forces(formula, parameters, targets, near.points, near.weights, hamaker, out)
        add_forces(formula, parameters, grid, far.points, far.weights, hamaker, values)
        _add_interpolated(clusters, vesicle, values, targets, out)
        _add_rows(out, density, vesicle, max(first - vesicle * n, 0))


@compiled
def add_clustered_stiffness(
    formula: PairFormula,
    parameters: Any,
    clusters: Clusters,
    points: Array,
    spacing: Array,
    first: int,
    last: int,
    hamaker: float,
    stiffness: Array,
) -> None:
    """Add the derivative of `add_clustered_density` at each point by that point.

    Parameters
    ----------
    formula : PairFormula
    parameters : tuple
        Of `formula_and_parameters`.
    clusters : Clusters
    points : (2, M, N)
    spacing : (M,)
    first, last : int
        The range of points, counted through all vesicles.
    hamaker : float
    stiffness : (3, M, N)
        Added to.
    """
    lists, n = _lists(clusters, points), points.shape[2]
    for vesicle in range(first // n, -(-last // n)):
        targets = _rows(points, vesicle, first, last)
        grid = chebyshev_points(clusters.tree, vesicle, clusters.nodes)
        near, far = _acting(formula, parameters, clusters, points, spacing, vesicle, lists)
        out, values = np.zeros((3, targets.shape[1])), np.zeros((3, grid.shape[1]))
        add_stiffnesses(formula, parameters, targets, near.points, near.weights, hamaker, out)
        add_stiffnesses(formula, parameters, grid, far.points, far.weights, hamaker, values)
        _add_interpolated(clusters, vesicle, values, targets, out)
        _add_rows(out, stiffness, vesicle, max(first - vesicle * n, 0))


@compiled
def clustered_energy(
    formula: PairFormula,
    parameters: Any,
    clusters: Clusters,
    points: Array,
    spacing: Array,
    first: int,
    last: int,
) -> float:
    """Compute ½∫∫ φ/H ds ds over some points and all other vesicles.

    Parameters
    ----------
    formula : PairFormula
    parameters : tuple
        Of `formula_and_parameters`.
    clusters : Clusters
    points : (2, M, N)
    spacing : (M,)
    first, last : int
        The range of points, counted through all vesicles.

    Returns
    -------
    float
    """
    lists, n, total = _lists(clusters, points), points.shape[2], 0.0
    for vesicle in range(first // n, -(-last // n)):
        targets = _rows(points, vesicle, first, last)
        near, far = _acting(formula, parameters, clusters, points, spacing, vesicle, lists)
        energy = pair_energy(formula, parameters, targets, near.points, near.weights)
        energy += pair_energy(formula, parameters, targets, far.points, far.weights)
        total += 0.5 * spacing[vesicle] * energy
    return total


@compiled
def _lists(clusters: Clusters, points: Array) -> SourceLists:
    """Make lists with room for all points, and as many for groups as there can be."""
    size = points.shape[1] * max(points.shape[2], clusters.nodes.size**2)
    return SourceLists(np.empty((3, size)), np.empty((3, size)))


@compiled
def _rows(points: Array, vesicle: int, first: int, last: int) -> Array:
    """Return the points of a vesicle that are in a range, (2, ·)."""
    n = points.shape[2]
    begin, end = max(first - vesicle * n, 0), min(last - vesicle * n, n)
    rows = np.empty((2, end - begin))
    for i in range(end - begin):
        rows[0, i], rows[1, i] = points[0, vesicle, begin + i], points[1, vesicle, begin + i]
    return rows


@compiled
def _acting(
    formula: PairFormula,
    parameters: Any,
    clusters: Clusters,
    points: Array,
    spacing: Array,
    vesicle: int,
    lists: SourceLists,
) -> tuple[_Sources, _Sources]:
    """Return what acts on each point of a vesicle, and what is interpolated to them."""
    near, far = write_sources(formula, parameters, clusters, points, spacing, vesicle, lists)
    return _taken(lists.near, near), _taken(lists.far, far)


@compiled
def _taken(sources: Array, count: int) -> _Sources:
    """Return some points of a list as arrays that loops become SIMD code for."""
    places, weights = np.empty((2, count)), np.empty(count)
    for k in range(count):
        places[0, k], places[1, k], weights[k] = sources[0, k], sources[1, k], sources[2, k]
    return _Sources(places, weights)


@compiled
def _add_rows(out: Array, total: Array, vesicle: int, begin: int) -> None:
    """Add values (c, ·) at the points of a vesicle from one on to those at all points, (c, M, N)."""
    for component in range(out.shape[0]):
        for i in range(out.shape[1]):
            total[component, vesicle, begin + i] += out[component, i]


@compiled
def _add_interpolated(clusters: Clusters, vesicle: int, values: Array, targets: Array, out: Array) -> None:
    """Add values (c, p²) at Chebyshev points about a vesicle, interpolated to targets (2, t) in its box."""
    tree, order = clusters.tree, clusters.nodes.size
    along, across = np.empty(order), np.empty(order)
    for i in range(targets.shape[1]):
        x = (targets[0, i] - tree.centers[0, vesicle]) / tree.extents[0, vesicle]
        y = (targets[1, i] - tree.centers[1, vesicle]) / tree.extents[1, vesicle]
        interpolate(x, clusters.nodes, clusters.scales, along)
        interpolate(y, clusters.nodes, clusters.scales, across)
        for component in range(out.shape[0]):
            total = 0.0
            for a in range(order):
                for b in range(order):
                    total += along[a] * across[b] * values[component, a * order + b]
            out[component, i] += total
