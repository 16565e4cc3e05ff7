"""Few points that stand for many vesicles in sums of a pair potential.

A smooth function in a box is its interpolant through p × p Chebyshev points.  So the sum over a group of
vesicles that is far away is one over such points, with the weights that make the sums over the vesicles'
points of all interpolated functions the same (Wang, Krasny & Tlupova 2020).  In the same way the force of
what is far away is computed at p × p points about a vesicle and interpolated to its own.  A single vesicle
far away is every second, fourth, … of its points.

With the distance d between two boxes and half the larger side a of one of them, (x − y)/r^k as a function in
this box is analytic in ellipses about its sides up to the parameter ρ = s + √(s² + 1), s = d/a, and
interpolation errs by about ρ^−p.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.forces.pair_formulas import PairFormula, derivatives

if TYPE_CHECKING:
    from solver.potentials.vesicle_tree import VesicleTree

Array = NDArray[np.float64]

_FEWEST = 16  # points that stand for a vesicle


class Clusters(NamedTuple):
    """The groups of a tree, as points.

    Attributes
    ----------
    tree : VesicleTree
        Of M vesicles.
    nodes, scales : (p,)
        Chebyshev points in [−1, 1], and what Lagrange's polynomials are multiplied by to be 1 at them.
    weights : (M − 1, p, p)
        Arclength that each point of a group stands for, by its place along x and y.
    lengths : (2·M − 1,)
        Of all membranes of each node.
    accuracy : float
        Allowed error of the force of a node, relative to that of the nearest vesicle.
    """

    tree: VesicleTree
    nodes: Array
    scales: Array
    weights: Array
    lengths: Array
    accuracy: float


class SourceLists(NamedTuple):
    """Points and the arclength that each stands for, with room for those of all vesicles.

    Attributes
    ----------
    near, far : (3, ·)
        Coordinates and weights: of sources that act on each point of a vesicle, and of those whose force is
        interpolated.
    """

    near: Array
    far: Array


@compiled
def clusters_of(tree: VesicleTree, points: Array, spacing: Array, order: int, accuracy: float) -> Clusters:
    """Find the points that stand for groups of vesicles.

    Parameters
    ----------
    tree : VesicleTree
        Of M vesicles.
    points : (2, M, N)
    spacing : (M,)
    order : int
        p.
    accuracy : float
        See `Clusters`.

    Returns
    -------
    Clusters
    """
    count, n = points.shape[1], points.shape[2]
    nodes = np.cos(np.pi * (np.arange(order) + 0.5) / order)
    scales = np.ones(order)
    for a in range(order):
        for b in range(order):
            if b != a:
                scales[a] /= nodes[a] - nodes[b]
    weights, lengths = np.zeros((count - 1, order, order)), np.empty(2 * count - 1)
    lengths[:count] = n * spacing
    for group in range(count - 2, -1, -1):
        node = count + group
        lengths[node] = 0.0
        for child in tree.children[group]:
            lengths[node] += lengths[child]
            if child < count:
                _add_weights(
                    tree, node, nodes, scales, points[:, child], np.full(n, spacing[child]), weights[group]
                )
            else:
                sources = chebyshev_points(tree, child, nodes)
                _add_weights(
                    tree, node, nodes, scales, sources, weights[child - count].ravel(), weights[group]
                )
    return Clusters(tree, nodes, scales, weights, lengths, accuracy)


@compiled
def chebyshev_points(tree: VesicleTree, node: int, nodes: Array) -> Array:
    """Return p × p points in the box of a node.

    Parameters
    ----------
    tree : VesicleTree
    node : int
    nodes : (p,)
        Chebyshev points in [−1, 1].

    Returns
    -------
    (2, p²)
        Row by row along y.
    """
    order = nodes.size
    grid = np.empty((2, order * order))
    for a in range(order):
        for b in range(order):
            grid[0, a * order + b] = tree.centers[0, node] + tree.extents[0, node] * nodes[a]
            grid[1, a * order + b] = tree.centers[1, node] + tree.extents[1, node] * nodes[b]
    return grid


@compiled
def _add_weights(
    tree: VesicleTree, node: int, nodes: Array, scales: Array, points: Array, lengths: Array, weights: Array
) -> None:
    """Add what the points in a node's box have of the sum of any interpolated function, (p, p)."""
    order = nodes.size
    along, across = np.empty(order), np.empty(order)
    for i in range(lengths.size):
        interpolate((points[0, i] - tree.centers[0, node]) / tree.extents[0, node], nodes, scales, along)
        interpolate((points[1, i] - tree.centers[1, node]) / tree.extents[1, node], nodes, scales, across)
        for a in range(order):
            for b in range(order):
                weights[a, b] += lengths[i] * along[a] * across[b]


@compiled
def interpolate(x: float, nodes: Array, scales: Array, out: Array) -> None:
    """Write Lagrange's polynomials of some nodes at a place.

    Parameters
    ----------
    x : float
    nodes, scales : (p,)
        As of `Clusters`.
    out : (p,)
        Written to.
    """
    for a in range(nodes.size):
        value = scales[a]
        for b in range(nodes.size):
            value *= x - nodes[b] if b != a else 1.0
        out[a] = value


@compiled
def _largest_force(formula: PairFormula, parameters: Any, clusters: Clusters, target: int) -> float:
    """Return a bound from below of the force per H of the nearest vesicle on another."""
    tree = clusters.tree
    count = tree.children.shape[0] + 1
    waiting = np.empty(count + 1, dtype=np.int64)
    waiting[0] = count
    left = 1
    least, nearest = np.inf, 0
    while left > 0:
        left -= 1
        node = waiting[left]
        dx = tree.centers[0, node] - tree.centers[0, target]
        dy = tree.centers[1, node] - tree.centers[1, target]
        distance = np.sqrt(dx * dx + dy * dy)
        if node < count:
            if node != target and distance < least:
                least, nearest = distance, node
        elif distance - tree.radii[node] < least:
            waiting[left], waiting[left + 1] = tree.children[node - count, 0], tree.children[node - count, 1]
            left += 2
    _, first, _ = derivatives(formula, least * least, parameters)
    return 2.0 * least * abs(first) * clusters.lengths[nearest]


@compiled
def write_sources(
    formula: PairFormula,
    parameters: Any,
    clusters: Clusters,
    points: Array,
    spacing: Array,
    target: int,
    out: SourceLists,
) -> tuple[int, int]:
    """Write the points that act on a vesicle.

    Parameters
    ----------
    formula : PairFormula
    parameters : tuple
        Of `formula_and_parameters`.
    clusters : Clusters
        Of at least two vesicles.
    points : (2, M, N)
    spacing : (M,)
    target : int
        The vesicle.
    out : SourceLists
        Written to.

    Returns
    -------
    near : int
        How many points are in the list of near ones.
    far : int
        And in the other.
    """
    tree, order = clusters.tree, clusters.nodes.size
    count = points.shape[1]
    allowed = clusters.accuracy * _largest_force(formula, parameters, clusters, target)
    waiting = np.empty(count + 1, dtype=np.int64)
    waiting[0] = count
    left, near, far = 1, 0, 0
    while left > 0:
        left -= 1
        node = waiting[left]
        if node == target:
            continue
        apart, needed = _needed(formula, parameters, clusters, target, node, allowed)
        if order * np.arcsinh(apart / tree.radii[target]) < needed:
            if node < count:
                near += _add_vesicle(clusters, points, spacing, target, node, needed, out.near[:, near:])
                continue
        elif node < count:
            far += _add_vesicle(clusters, points, spacing, target, node, needed, out.far[:, far:])
            continue
        elif order * np.arcsinh(apart / max(tree.extents[0, node], tree.extents[1, node])) >= needed:
            _add_group(clusters, node, out.far[:, far:])
            far += order * order
            continue
        waiting[left], waiting[left + 1] = tree.children[node - count, 0], tree.children[node - count, 1]
        left += 2
    return near, far


@compiled
def _needed(
    formula: PairFormula, parameters: Any, clusters: Clusters, target: int, node: int, allowed: float
) -> tuple[float, float]:
    """Return the distance between the boxes of two nodes, and −log of the relative error allowed there."""
    tree = clusters.tree
    dx = abs(tree.centers[0, node] - tree.centers[0, target])
    dy = abs(tree.centers[1, node] - tree.centers[1, target])
    x = max(dx - tree.extents[0, node] - tree.extents[0, target], 0.0)
    y = max(dy - tree.extents[1, node] - tree.extents[1, target], 0.0)
    apart, between = np.sqrt(x * x + y * y), np.sqrt(dx * dx + dy * dy)
    if apart == 0.0:
        return 0.0, np.inf
    # Of the force from as near as there and from the center, as it vanishes somewhere.
    _, first, _ = derivatives(formula, apart * apart, parameters)
    _, at_center, _ = derivatives(formula, between * between, parameters)
    force = 2.0 * max(apart * abs(first), between * abs(at_center)) * clusters.lengths[node]
    return apart, np.log(max(force / allowed, 1.0))


@compiled
def _add_vesicle(
    clusters: Clusters, points: Array, spacing: Array, target: int, source: int, needed: float, out: Array
) -> int:
    """Write points of a vesicle and their weights, and return how many these are.

    The sum over n points of a circle of radius R errs by (1 + d/R)^−n at the distance d from it.  Twice as
    many are taken, as vesicles are no circles; measured.
    """
    tree, n = clusters.tree, points.shape[2]
    dx = tree.centers[0, source] - tree.centers[0, target]
    dy = tree.centers[1, source] - tree.centers[1, target]
    apart = max(np.sqrt(dx * dx + dy * dy) - tree.radii[source] - tree.radii[target], 0.0)
    decay_per_point = np.log1p(apart / tree.radii[source])
    step = 1
    while n % (2 * step) == 0 and n >= _FEWEST * 2 * step and n * decay_per_point >= needed * 4 * step:
        step *= 2
    for i in range(n // step):
        out[0, i], out[1, i] = points[0, source, i * step], points[1, source, i * step]
        out[2, i] = spacing[source] * step
    return n // step


@compiled
def _add_group(clusters: Clusters, node: int, out: Array) -> None:
    """Write the points that stand for a group, and their weights."""
    tree, order = clusters.tree, clusters.nodes.size
    grid = chebyshev_points(tree, node, clusters.nodes)
    weights = clusters.weights[node - tree.children.shape[0] - 1]
    for k in range(order * order):
        out[0, k], out[1, k], out[2, k] = grid[0, k], grid[1, k], weights[k // order, k % order]
