"""Work that several ranks share: which rows of a sum each one computes, and how all of them get the whole.

Every rank of a group takes the same path through a run.  A row is computed by one rank and then sent to all,
and nothing is summed across ranks.  So all have the same state to the last bit and decide alike.  This needs
processors that round alike, which `require_agreement` checks after every step.  With another number of ranks
a row differs by round-off at most, because a matrix product then has other rows.

Here are the protocols and the run on a single rank.  How ranks talk to each other, by MPI or otherwise, is up
to the package that implements `Parallel`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
T = TypeVar("T")


class RanksDifferError(RuntimeError):
    """The ranks of a run no longer take the same path: the job must end, or they would wait for ever."""


class Shares(Protocol):
    """A division of rows among ranks, in which those of each rank are consecutive."""

    @property
    def own(self) -> slice:
        """The rows of this rank; there may be none."""

    def gather(self, part: Array, axis: int = 0) -> Array:
        """Return all rows, on every rank, from those of each rank.

        Collective.

        Parameters
        ----------
        part : (..., own rows, ...)
        axis : int
            Of the rows.

        Returns
        -------
        (..., rows, ...)
            A new array if there is more than one rank.
        """


class Parallel(Protocol):
    """The ranks that compute one run together."""

    @property
    def rank(self) -> int:
        """Number of this rank, from 0."""

    @property
    def size(self) -> int:
        """Number of ranks."""

    def divide(self, rows: int, cost: Callable[[], Array] | None = None) -> Shares:
        """Share out rows evenly.

        Parameters
        ----------
        rows : int
        cost : callable, optional
            Returns the costs, (rows,), the same on all ranks.  Without it all rows cost the same.

        Returns
        -------
        Shares
        """

    def agree(self, value: T) -> T:
        """Return the value that the first rank has.

        Collective.

        Parameters
        ----------
        value : object
            Of this rank.

        Returns
        -------
        object
        """


class _Everything:
    """All rows on one rank."""

    def __init__(self, rows: int) -> None:
        self.own = slice(0, rows)

    def gather(self, part: Array, axis: int = 0) -> Array:
        return part


class Serial:
    """A run on a single rank."""

    rank = 0
    size = 1

    def divide(self, rows: int, cost: Callable[[], Array] | None = None) -> Shares:
        """Give all rows to the only rank.

        Parameters
        ----------
        rows : int
        cost : callable, optional
            Not called.

        Returns
        -------
        Shares
        """
        return _Everything(rows)

    def agree(self, value: T) -> T:
        """Return the value.

        Parameters
        ----------
        value : object

        Returns
        -------
        object
        """
        return value


SERIAL = Serial()


def even_bounds(cost: Array, size: int) -> NDArray[np.int64]:
    """Return where each share of rows begins, and where the last one ends.

    A row belongs to the share in which the middle of its cost falls.

    Parameters
    ----------
    cost : (rows,)
        Positive.
    size : int
        Number of shares.

    Returns
    -------
    (size + 1,)
    """
    reached = np.cumsum(cost)
    goals = np.arange(size + 1) / size * reached[-1]
    bounds = np.searchsorted(reached - 0.5 * cost, goals)
    bounds[0], bounds[-1] = 0, cost.size
    return np.asarray(bounds, dtype=np.int64)


def first_rank_asks(parallel: Parallel, question: Callable[[], bool] | None) -> Callable[[], bool] | None:
    """Make a question whose answer is that of the first rank, on all ranks.

    Collective, and so are the calls of the result.

    Parameters
    ----------
    parallel : Parallel
    question : callable or None

    Returns
    -------
    callable or None
        None if the first rank has no question.
    """
    if not parallel.agree(question is not None):
        return None
    return lambda: parallel.agree(bool(question and parallel.rank == 0 and question()))


def require_agreement(parallel: Parallel, value: float) -> None:
    """Check that all ranks have computed the same number.

    Collective.

    Parameters
    ----------
    parallel : Parallel
    value : float
        Of this rank.

    Raises
    ------
    RanksDifferError
        On a rank whose number is not that of the first one.
    """
    if (first := parallel.agree(value)) != value:
        raise RanksDifferError(
            f"rank {parallel.rank} of a run has come to {value!r} and the first one to {first!r}: "
            "do their processors round alike?"
        )
