"""Nodes within a time step and the quadrature between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GaussLobatto:
    """Gauss–Lobatto nodes on [0, 1]: both ends and the extrema of a Legendre polynomial.

    The quadrature over [0, 1] is exact to degree 2·count − 3, between neighboring nodes to count − 1.

    Attributes
    ----------
    count : int
        Number of nodes.
    """

    count: int

    @cached_property
    def nodes(self) -> Array:
        """The nodes in ascending order, (count,)."""
        from scipy.special import roots_jacobi  # for the reason that `solver.membrane.shapes` gives

        interior = roots_jacobi(self.count - 2, 1, 1)[0] if self.count > 2 else np.empty(0)
        nodes = (1 + np.concatenate([[-1.0], interior, [1.0]])) / 2
        return np.asarray((nodes + 1 - nodes[::-1]) / 2)  # symmetric to the last bit

    @cached_property
    def intervals(self) -> Array:
        """The distances between neighboring nodes, (count − 1,)."""
        return np.diff(self.nodes)

    @cached_property
    def integration(self) -> Array:
        """The matrix of integrals between neighboring nodes from values at all nodes, (count − 1, count)."""
        from scipy.interpolate import KroghInterpolator  # for the reason that `solver.membrane.shapes` gives

        abscissas, weights = np.polynomial.legendre.leggauss(self.count)
        basis = KroghInterpolator(self.nodes, np.eye(self.count))
        points = self.nodes[:-1, None] + self.intervals[:, None] * (1 + abscissas) / 2
        return np.asarray(np.einsum("i,q,iqn->in", self.intervals, weights / 2, basis(points)))
