"""Which vesicles hold together: the graph of their contacts, and its connected parts, the clusters.

Two vesicles are in contact when their membranes are nearer than `CONTACT` times the adhesion's distance δ.
Two points attract each other beyond δ, the most at 1.29 δ (exponents 4 and 2), and two membranes at rest
are held at somewhat less than δ, so a pair this near is bound to each other unless the flow parts them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from solver.membrane.geometry import Geometry

Array = NDArray[np.float64]

CONTACT = 1.5  # adhesion distances


def contacts(geometry: Geometry, distance: float) -> NDArray[np.int64]:
    """Pairs (k, 2) of vesicles of which two points are at most ``distance`` apart, each pair once.

    Only near points are compared, found in a tree.
    """
    points = geometry.points.reshape(2, -1).T
    near = cKDTree(points).query_pairs(distance, output_type="ndarray") // geometry.membranes.points
    return np.unique(near[near[:, 0] < near[:, 1]], axis=0).astype(np.int64)


def clusters(geometry: Geometry, distance: float) -> Array:
    """Number of the cluster of each vesicle, (M,).  A vesicle without contact is a cluster of its own.

    Clusters are numbered from 0 by their first vesicle.
    """
    count = geometry.membranes.count
    first, second = contacts(geometry, distance).T
    graph = coo_array((np.ones(first.size), (first, second)), shape=(count, count))
    _, labels = connected_components(graph, directed=False)
    return np.asarray(labels, dtype=np.float64)


def cluster_sizes(labels: Array) -> NDArray[np.int64]:
    """Number of vesicles in each cluster, from their labels (M,)."""
    return np.bincount(labels.astype(np.int64))
