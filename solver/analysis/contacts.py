"""Clusters of vesicles: the connected parts of the graph of their contacts.

Two vesicles are in contact when their membranes are nearer than `CONTACT` times the adhesion distance δ.
Beyond δ two points attract each other, most strongly at 1.29 δ (exponents 4 and 2), and two membranes at rest
are somewhat nearer than δ.  So a pair in contact stays together unless the flow pulls it apart.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from solver.membrane.geometry import Geometry

Array = NDArray[np.float64]

CONTACT = 1.5  # adhesion distances


def contacts(geometry: Geometry, distance: float) -> NDArray[np.int64]:
    """Return the pairs of vesicles that are in contact.

    Only near points are compared, found in a tree.

    Parameters
    ----------
    geometry : Geometry
    distance : float
        At most so far apart are two points of vesicles in contact.

    Returns
    -------
    (k, 2)
        Each pair once.
    """
    from scipy.spatial import cKDTree  # for the reason that `solver.membrane.shapes` gives

    points = geometry.points.reshape(2, -1).T
    near = cKDTree(points).query_pairs(distance, output_type="ndarray") // geometry.membranes.points
    return np.unique(near[near[:, 0] < near[:, 1]], axis=0).astype(np.int64)


def clusters(geometry: Geometry, distance: float) -> Array:
    """Return the number of the cluster of each vesicle.

    A vesicle without contact is a cluster of one.  Clusters are numbered from 0 by their first vesicle.

    Parameters
    ----------
    geometry : Geometry
    distance : float
        As for `contacts`.

    Returns
    -------
    (M,)
    """
    from scipy.sparse import coo_array  # for the reason that `solver.membrane.shapes` gives
    from scipy.sparse.csgraph import connected_components

    count = geometry.membranes.count
    first, second = contacts(geometry, distance).T
    graph = coo_array((np.ones(first.size), (first, second)), shape=(count, count))
    _, labels = connected_components(graph, directed=False)
    return np.asarray(labels, dtype=np.float64)


def cluster_sizes(labels: Array) -> NDArray[np.int64]:
    """Return the number of vesicles in each cluster.

    Parameters
    ----------
    labels : (M,)
        As of `clusters`.

    Returns
    -------
    (clusters,)
    """
    return np.bincount(labels.astype(np.int64))
