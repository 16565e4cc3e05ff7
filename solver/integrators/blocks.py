"""An approximate Jacobian in which the parts of the state do not see each other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BlockDiagonal:
    """A matrix of one dense block for each of M parts of a state.

    blocks : (M, n, n)
    members : (M, n)
        Which elements of the state each part has; every element is in one part.
    """

    blocks: Array
    members: NDArray[np.int64]

    def __matmul__(self, state: Array) -> Array:
        return self._apply(self.blocks, state)

    def solver(self, duration: float) -> Callable[[Array], Array]:
        """Solve (I − duration·matrix) x = b, from b (n,) to x (n,)."""
        inverses = np.asarray(np.linalg.inv(np.eye(self.blocks.shape[1]) - duration * self.blocks))
        return lambda right: self._apply(inverses, right)

    def _apply(self, blocks: Array, state: Array) -> Array:
        result = np.empty_like(state)
        result[self.members] = (blocks @ state[self.members][:, :, None])[:, :, 0]
        return result
