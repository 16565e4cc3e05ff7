"""Jacobians of an equation of motion, and the linear systems that implicit steps solve with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

if TYPE_CHECKING:
    from solver.memory import Saved
    from solver.parallel import Shares

Array = NDArray[np.float64]


class Jacobian(Protocol):
    """The derivative J of a rate by the state, exact or close to it.

    Where several ranks share a run, all calls are collective.
    """

    @property
    def exact(self) -> bool:
        """Whether errors of the state can be followed with it; an approximate one lacks too much."""

    def __matmul__(self, direction: Array) -> Array:
        """Return J times a direction.

        Parameters
        ----------
        direction : (n,) or (n, k)

        Returns
        -------
        (n,) or (n, k)
        """

    def saved(self) -> Saved:
        """Return it as plain values (`solver.memory`).

        Returns
        -------
        dict
        """

    def solver(self, duration: float) -> Callable[[Array], Array]:
        """Factorize I − duration·J.

        Parameters
        ----------
        duration : float
            Part of a time step, as the implicit method has it.

        Returns
        -------
        callable
            From a right-hand side b (n,) or (n, k) to the solution x of (I − duration·J) x = b.
        """


@dataclass(frozen=True)
class DenseJacobian:
    """A Jacobian as a matrix.

    Attributes
    ----------
    matrix : (n, n)
    """

    exact: ClassVar[bool] = True

    matrix: Array

    def __matmul__(self, direction: Array) -> Array:
        """Return J times a direction.

        Parameters
        ----------
        direction : (n,)

        Returns
        -------
        (n,)
        """
        return np.asarray(self.matrix @ direction)

    def saved(self) -> Saved:
        """Return the matrix; see `Jacobian`.

        Returns
        -------
        dict
        """
        return {"matrix": self.matrix}

    def solver(self, duration: float) -> Callable[[Array], Array]:
        """Factorize I − duration·J; see `Jacobian`.

        Parameters
        ----------
        duration : float
            Part of a time step.

        Returns
        -------
        callable
            From a right-hand side (n,) to the solution (n,).
        """
        system = -duration * self.matrix
        system.flat[:: len(system) + 1] += 1
        # The factors are of the transposed matrix: LAPACK counts rows and columns the other way.
        factors, pivots, _ = lapack.dgetrf(system.T, overwrite_a=1)
        return lambda right: np.asarray(lapack.dgetrs(factors, pivots, right, trans=1)[0])


@dataclass(frozen=True)
class BlockDiagonal:
    """An approximate Jacobian without what the parts of a state do to each other.

    Attributes
    ----------
    blocks : (m, n, n)
        One dense block for each of the m parts that are this rank's.
    members : (M, n) array of int
        The elements of the state that belong to each of all M parts; every element belongs to one part.
    shares : Shares
        How the parts are shared out among the ranks.
    """

    exact: ClassVar[bool] = False

    blocks: Array
    members: NDArray[np.int64]
    shares: Shares

    def __matmul__(self, direction: Array) -> Array:
        """Return J times a direction.  Collective.

        Parameters
        ----------
        direction : (M·n,)

        Returns
        -------
        (M·n,)
        """
        parts = direction[self.members[self.shares.own]]
        result = np.empty_like(direction)
        result[self.members] = self.shares.gather((self.blocks @ parts[:, :, None])[:, :, 0])
        return result

    def saved(self) -> Saved:
        """Return the blocks of all ranks; see `Jacobian`.

        Returns
        -------
        dict
        """
        return {"blocks": self.shares.gather(self.blocks)}

    def solver(self, duration: float) -> Callable[[Array], Array]:
        """Invert the blocks of I − duration·J; see `Jacobian`.  Calls of the result are collective.

        Parameters
        ----------
        duration : float
            Part of a time step.

        Returns
        -------
        callable
            From a right-hand side (M·n,) to the solution (M·n,).
        """
        inverses = np.asarray(np.linalg.inv(np.eye(self.members.shape[1]) - duration * self.blocks))
        return replace(self, blocks=inverses).__matmul__
