"""A binary tree of groups of vesicles, and which groups act on a vesicle by series.

The root holds all vesicles.  A group is split in two at the middle of the longer side of the box about its
vesicles, until a vesicle is left.  Vesicles do not overlap, so that the depth grows like the
logarithm of their number.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class VesicleTree(NamedTuple):
    """Groups of M vesicles, M − 1 of them.

    Node k < M is vesicle k; node M + g is group g, and the root is the first group.

    Attributes
    ----------
    centers : (2, 2·M − 1)
        Of circles about the vesicles of each node.
    radii : (2·M − 1,)
        Of these circles.
    extents : (2, 2·M − 1)
        Half the width and height of boxes, with the same centers, that hold the vesicles' circles.
    children : (M − 1, 2)
        Nodes of which each group consists.  Groups come before those in them.
    """

    centers: Array
    radii: Array
    extents: Array
    children: Indices


class FarNodes(NamedTuple):
    """Which nodes act by series on which vesicles.

    Attributes
    ----------
    targets, nodes : (k,)
        A vesicle and a node of the tree.
    source_orders, target_orders : (k,)
        Highest power in the series about the node, and in that about the vesicle.
    """

    targets: Indices
    nodes: Indices
    source_orders: Indices
    target_orders: Indices


class NearVesicles(NamedTuple):
    """Which vesicles act on which, point by point; every one acts on itself.

    Attributes
    ----------
    targets, sources : (k,)
        Vesicles; the targets ascend.
    """

    targets: Indices
    sources: Indices


@compiled
def vesicle_tree(centers: Array, radii: Array) -> VesicleTree:
    """Build the tree.

    Parameters
    ----------
    centers : (2, M)
    radii : (M,)
        Of circles that hold the vesicles.

    Returns
    -------
    VesicleTree
    """
    count = radii.size
    node_centers, node_radii = np.empty((2, 2 * count - 1)), np.empty(2 * count - 1)
    extents = np.empty((2, 2 * count - 1))
    for vesicle in range(count):
        node_radii[vesicle] = radii[vesicle]
        for axis in range(2):
            node_centers[axis, vesicle], extents[axis, vesicle] = centers[axis, vesicle], radii[vesicle]
    children = np.empty((count - 1, 2), dtype=np.int64)
    members = np.arange(count)
    # Ranges of members that are still to be made nodes: first, last, and the place among the children.
    waiting = np.empty((count + 1, 3), dtype=np.int64)
    waiting[0, 0], waiting[0, 1], waiting[0, 2] = 0, count, -1
    left, groups = 1, 0
    while left > 0:
        left -= 1
        first, last, place = waiting[left, 0], waiting[left, 1], waiting[left, 2]
        node = members[first]
        if last - first > 1:
            node = count + groups
            _enclose(members[first:last], node, node_centers, node_radii, extents)
            middle = _divide(members[first:last], node, node_centers, extents)
            waiting[left, 0], waiting[left, 1], waiting[left, 2] = first, first + middle, 2 * groups
            waiting[left + 1, 0], waiting[left + 1, 1] = first + middle, last
            waiting[left + 1, 2] = 2 * groups + 1
            left += 2
            groups += 1
        if place >= 0:
            children[place // 2, place % 2] = node
    return VesicleTree(node_centers, node_radii, extents, children)


@compiled
def _enclose(members: Indices, node: int, centers: Array, radii: Array, extents: Array) -> None:
    """Write the circle and the box about a group."""
    for axis in range(2):
        least, most = np.inf, -np.inf
        for member in members:
            least = min(least, centers[axis, member] - radii[member])
            most = max(most, centers[axis, member] + radii[member])
        centers[axis, node], extents[axis, node] = 0.5 * (least + most), 0.5 * (most - least)
    radius = 0.0
    for member in members:
        dx, dy = centers[0, member] - centers[0, node], centers[1, member] - centers[1, node]
        radius = max(radius, np.sqrt(dx * dx + dy * dy) + radii[member])
    radii[node] = radius


@compiled
def _divide(members: Indices, node: int, centers: Array, extents: Array) -> int:
    """Put the members of a group's first half first, and return their number."""
    axis = 0 if extents[0, node] >= extents[1, node] else 1
    half = 0
    for k in range(members.size):
        member = members[k]
        if centers[axis, member] < centers[axis, node]:
            members[k] = members[half]
            members[half] = member
            half += 1
    # Vesicles of different sizes may all have their centers on one side.
    return half if 0 < half < members.size else members.size // 2


@compiled
def interactions(
    tree: VesicleTree, accuracy: float, largest_order: int, largest_of_group: int, first: int, last: int
) -> tuple[FarNodes, NearVesicles]:
    """Find the nodes that act on some vesicles by series, and the vesicles that act on them point by point.

    Series in powers up to p about a circle of radius R err by (R/d)^p at the distance d from its center.

    Parameters
    ----------
    tree : VesicleTree
    accuracy : float
        Relative error allowed.
    largest_order : int
        Highest power that is allowed.
    largest_of_group : int
        The same about a group; its children are taken where it needs more.
    first, last : int
        The range of the vesicles.

    Returns
    -------
    far : FarNodes
    near : NearVesicles
    """
    count = tree.children.shape[0] + 1
    needed = -np.log(accuracy)
    least, least_of_group = np.exp(needed / largest_order), np.exp(needed / largest_of_group)
    room = last - first + 1
    found, pairs = np.empty((64 * room, 4), dtype=np.int64), np.empty((8 * room, 2), dtype=np.int64)
    far = near = 0
    waiting = np.empty(count + 1, dtype=np.int64)
    for target in range(first, last):
        x, y, radius = tree.centers[0, target], tree.centers[1, target], tree.radii[target]
        waiting[0] = count if count > 1 else 0
        left = 1
        while left > 0:
            left -= 1
            node = waiting[left]
            dx, dy = tree.centers[0, node] - x, tree.centers[1, node] - y
            distance = np.sqrt(dx * dx + dy * dy)
            from_node = (distance - radius) / tree.radii[node]
            from_target = (distance - tree.radii[node]) / radius
            if from_node >= (least if node < count else least_of_group) and from_target >= least:
                if far == found.shape[0]:
                    found = np.concatenate((found, np.empty_like(found)))
                found[far, 0], found[far, 1] = target, node
                found[far, 2] = int(np.ceil(needed / np.log(from_node)))
                found[far, 3] = int(np.ceil(needed / np.log(from_target)))
                far += 1
            elif node >= count:
                waiting[left], waiting[left + 1] = (
                    tree.children[node - count, 0],
                    tree.children[node - count, 1],
                )
                left += 2
            else:
                if near == pairs.shape[0]:
                    pairs = np.concatenate((pairs, np.empty_like(pairs)))
                pairs[near, 0], pairs[near, 1] = target, node
                near += 1
    columns, sides = found[:far].T.copy(), pairs[:near].T.copy()
    return FarNodes(columns[0], columns[1], columns[2], columns[3]), NearVesicles(sides[0], sides[1])
