"""The ranks of an MPI communicator, as those that compute one run together."""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.parallel import Shares, T, even_bounds

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

Array = NDArray[np.float64]


class Ranks:
    """A run on all ranks of a communicator.

    Parameters
    ----------
    communicator : Intracomm
        Not to be used for anything else while the run lasts.
    """

    def __init__(self, communicator: Intracomm) -> None:
        self._communicator = communicator
        self.rank: int = communicator.Get_rank()
        self.size: int = communicator.Get_size()

    def divide(self, rows: int, cost: Callable[[], Array] | None = None) -> Shares:
        """Share out rows so that each rank has about the same cost, see `Parallel`.

        Parameters
        ----------
        rows : int
        cost : callable, optional

        Returns
        -------
        Shares
        """
        costs = cost() if cost else np.ones(rows)
        return _Division(self._communicator, even_bounds(costs, self.size))

    def agree(self, value: T) -> T:
        """Return the value that the first rank has, see `Parallel`.

        Parameters
        ----------
        value : object

        Returns
        -------
        object
        """
        agreed: T = self._communicator.bcast(value)
        return agreed


class _Division:
    """Rows shared out among the ranks of a communicator: rank k has those from bounds[k] to bounds[k + 1]."""

    def __init__(self, communicator: Intracomm, bounds: NDArray[np.int64]) -> None:
        self._communicator = communicator
        self._rows = int(bounds[-1])
        self._starts, self._counts = bounds[:-1], np.diff(bounds)
        rank = communicator.Get_rank()
        self.own = slice(int(bounds[rank]), int(bounds[rank + 1]))

    def gather(self, part: Array, axis: int = 0) -> Array:
        rows = np.ascontiguousarray(part if axis == 0 else np.moveaxis(part, axis, 0))
        whole = np.empty((self._rows, *rows.shape[1:]))
        width = prod(rows.shape[1:])
        self._communicator.Allgatherv(rows, [whole, (self._counts * width, self._starts * width)])
        return whole if axis == 0 else np.ascontiguousarray(np.moveaxis(whole, 0, axis))
