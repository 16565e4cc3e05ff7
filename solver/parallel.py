"""Work that several ranks share: which rows of a sum each computes, and how all come to have the whole.

Every rank of a group takes the same path through a run.  A row is computed by one rank alone and then known
to all, and nothing is summed across ranks: so all have the same state to the last bit, and decide alike.
(Their processors must round alike, which is checked after every step by `require_agreement`.)  With another
number of ranks a row differs by round-off only, where the rows of a matrix product are other ones.
"""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
T = TypeVar("T")


class RanksDifferError(RuntimeError):
    """The ranks of a run no longer take the same path; the job must end, or they would wait for ever."""


class Shares(Protocol):
    """A division of rows: those of this rank are neighbors."""

    @property
    def own(self) -> slice:
        """The rows of this rank; perhaps none."""

    def gather(self, part: Array, axis: int = 0) -> Array:
        """All rows, on every rank, from each rank's own, along an axis.

        Collective.  With more than one rank the result is a new array.
        """


class Parallel(Protocol):
    """The ranks that compute one run together."""

    @property
    def rank(self) -> int:
        """Which of them this is, from 0."""

    @property
    def size(self) -> int:
        """How many there are."""

    def divide(self, rows: int, cost: Callable[[], Array] | None = None) -> Shares:
        """Share out rows evenly.

        ``cost`` is asked for the costs, (rows,), alike on all ranks; without it all rows cost the same.
        """

    def agree(self, value: T) -> T:
        """What the first rank has for this value.

        Collective.
        """


class _Everything:
    """All of ``rows`` rows on one rank."""

    def __init__(self, rows: int) -> None:
        self.own = slice(0, rows)

    def gather(self, part: Array, axis: int = 0) -> Array:
        """See `Shares`."""
        return part


class Serial:
    """A run on one rank alone."""

    rank = 0
    size = 1

    def divide(self, rows: int, cost: Callable[[], Array] | None = None) -> Shares:
        """See `Parallel`."""
        return _Everything(rows)

    def agree(self, value: T) -> T:
        """See `Parallel`."""
        return value


SERIAL = Serial()


class Ranks:
    """A run on all ranks of a communicator.

    Parameters
    ----------
    communicator : mpi4py.MPI.Intracomm
        Used by this run alone while it lasts.
    """

    def __init__(self, communicator: Any) -> None:
        self._communicator = communicator
        self.rank: int = communicator.Get_rank()
        self.size: int = communicator.Get_size()

    def divide(self, rows: int, cost: Callable[[], Array] | None = None) -> Shares:
        """See `Parallel`."""
        costs = cost() if cost else np.ones(rows)
        return _Division(self._communicator, even_bounds(costs, self.size))

    def agree(self, value: T) -> T:
        """See `Parallel`."""
        agreed: T = self._communicator.bcast(value)
        return agreed


class _Division:
    """Rows shared out among the ranks of a communicator; rank k has those from bounds[k] to bounds[k + 1]."""

    def __init__(self, communicator: Any, bounds: NDArray[np.int64]) -> None:
        self._communicator = communicator
        self._rows = int(bounds[-1])
        self._starts, self._counts = bounds[:-1], np.diff(bounds)
        rank = communicator.Get_rank()
        self.own = slice(int(bounds[rank]), int(bounds[rank + 1]))

    def gather(self, part: Array, axis: int = 0) -> Array:
        """See `Shares`."""
        rows = np.ascontiguousarray(part if axis == 0 else np.moveaxis(part, axis, 0))
        whole = np.empty((self._rows, *rows.shape[1:]))
        width = prod(rows.shape[1:])
        self._communicator.Allgatherv(rows, [whole, (self._counts * width, self._starts * width)])
        return whole if axis == 0 else np.ascontiguousarray(np.moveaxis(whole, 0, axis))


def even_bounds(cost: Array, size: int) -> NDArray[np.int64]:
    """Where each of ``size`` shares of rows begins, and the last one ends, (size + 1,).

    A row, whose cost is positive, belongs to the share in which the middle of its cost falls.
    """
    reached = np.cumsum(cost)
    goals = np.arange(size + 1) / size * reached[-1]
    bounds = np.searchsorted(reached - 0.5 * cost, goals)
    bounds[0], bounds[-1] = 0, cost.size
    return np.asarray(bounds, dtype=np.int64)


def first_rank_asks(parallel: Parallel, question: Callable[[], bool] | None) -> Callable[[], bool] | None:
    """The question, asked on the first rank for all of them.

    None if the first rank has none.  Collective, and so are the calls of the result.
    """
    if not parallel.agree(question is not None):
        return None
    return lambda: parallel.agree(bool(question and parallel.rank == 0 and question()))


def require_agreement(parallel: Parallel, value: float) -> None:
    """Check that all ranks have come to the same number.

    Collective.

    Raises
    ------
    RanksDifferError
        On a rank that has another number than the first one.
    """
    if (first := parallel.agree(value)) != value:
        raise RanksDifferError(
            f"rank {parallel.rank} of a run has come to {value!r} and the first one to {first!r}: "
            "do their processors round alike?"
        )
