"""An approximate Jacobian in which the parts of the state do not see each other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from solver.parallel import Shares

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BlockDiagonal:
    """A matrix of one dense block for each of M parts of a state.

    blocks : (m, n, n)
        Of the m parts that are this rank's.
    members : (M, n)
        Which elements of the state each part has; every element is in one part.
    shares : Shares
        Of the parts.
    """

    blocks: Array
    members: NDArray[np.int64]
    shares: Shares

    def __matmul__(self, state: Array) -> Array:
        """The product with a state (n,).

        Collective.
        """
        own = state[self.members[self.shares.own]]
        result = np.empty_like(state)
        result[self.members] = self.shares.gather((self.blocks @ own[:, :, None])[:, :, 0])
        return result

    def solver(self, duration: float) -> Callable[[Array], Array]:
        """Solve (I − duration·matrix) x = b, from b (n,) to x (n,); collective as the product is."""
        inverses = np.asarray(np.linalg.inv(np.eye(self.members.shape[1]) - duration * self.blocks))
        return replace(self, blocks=inverses).__matmul__
