"""A branch of steady states, as following it returns it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class BranchPoint:
    """A steady state on a branch.

    Attributes
    ----------
    parameter : float
    state : (n,)
        Of the vesicles that are computed.
    tangent : (n + 1,)
        Direction of the branch, of unit length; its last element is that of the parameter.
    eigenvalues : complex (k,)
        Of the perturbations of all vesicles that grow fastest, the fastest first, 1/time.
    unstable : int
        How many perturbations grow.
    """

    parameter: float
    state: Array
    tangent: Array
    eigenvalues: ComplexArray
    unstable: int

    @property
    def stable(self) -> bool:
        """Whether no perturbation grows."""
        return self.unstable == 0


@dataclass(frozen=True)
class Branch:
    """Steady states that change into each other as a parameter changes.

    Attributes
    ----------
    points : tuple of BranchPoint
        In their order along the branch.
    folds : tuple of BranchPoint
        Where the parameter turns back: two steady states meet there and are gone beyond.
    crossings : tuple of BranchPoint
        Where perturbations begin or cease to grow, other than at folds.
    ended : str
        Why the branch was followed no farther.
    """

    points: tuple[BranchPoint, ...]
    folds: tuple[BranchPoint, ...]
    crossings: tuple[BranchPoint, ...]
    ended: str
