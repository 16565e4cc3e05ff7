"""Groups of ranks, each of which computes one run at a time together.

The first rank of a group is its leader.  Only the leader exchanges messages with the dispatcher, stages
results and decides whether a run goes on; the others follow it.  If the ranks do not divide evenly, the last
group is smaller, so that no rank is left over.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self, cast

from ensemble.errors import BadInput
from ensemble.mpi.scaling_model import recommended_ranks

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from solver.parallel import Parallel
    from solver.scene import Scene


AUTOMATIC = "auto"


@dataclass(frozen=True)
class Groups:
    """One rank's view of the groups; every rank makes it at the same time.

    Attributes
    ----------
    everyone : Intracomm
        All ranks; the first one leads the first group.
    group : Intracomm
        The ranks of this rank's group.
    leaders : Intracomm or None
        The leaders of all groups; None on a rank that follows.
    """

    everyone: Intracomm
    group: Intracomm
    leaders: Intracomm | None

    @classmethod
    def of(cls, communicator: Intracomm, ranks_per_run: int) -> Self:
        """Split a communicator into groups of neighboring ranks.

        Collective.

        Parameters
        ----------
        communicator : Intracomm
            All ranks.
        ranks_per_run : int
            How many ranks a group has, at least 1.

        Returns
        -------
        Groups
            This rank's view of them.

        Raises
        ------
        BadInput
            On every rank, if there are fewer ranks than a group has, or none in a group.
        """
        checked_ranks(ranks_per_run, communicator.Get_size())
        everyone = communicator.Dup()
        rank = everyone.Get_rank()
        group = split(everyone, rank // ranks_per_run)
        assert group is not None
        return cls(everyone, group, split(everyone, 0 if group.Get_rank() == 0 else None))

    @property
    def parallel(self) -> Parallel:
        """How this rank's group computes a run."""
        from ensemble.mpi.ranks import Ranks
        from solver.parallel import SERIAL

        return Ranks(self.group) if self.group.Get_size() > 1 else SERIAL

    @property
    def followers(self) -> range:
        """The ranks within the group that follow its leader."""
        return range(1, self.group.Get_size())

    def free(self) -> None:
        """Give the communicators back.  Collective."""
        if self.leaders is not None:
            self.leaders.Free()
        self.group.Free()
        self.everyone.Free()


def split(communicator: Intracomm, color: int | None) -> Intracomm | None:
    """Return the communicator of all ranks that give the same color, in the same order.

    Collective.

    Parameters
    ----------
    communicator : Intracomm
        The ranks that are split.
    color : int or None
        Of this rank.

    Returns
    -------
    Intracomm or None
        None for a rank without a color.
    """
    from mpi4py import MPI

    part = communicator.Split(MPI.UNDEFINED if color is None else color, communicator.Get_rank())
    return None if color is None else cast("Intracomm", part)


def checked_ranks(ranks_per_run: int, size: int) -> int:
    """Return the number of ranks for a run, if it is possible.

    Parameters
    ----------
    ranks_per_run : int
        How many ranks are to compute a run together.
    size : int
        How many there are.

    Returns
    -------
    int
        The same number.

    Raises
    ------
    BadInput
        If it is not between 1 and the number of ranks.
    """
    if not 1 <= ranks_per_run <= size:
        raise BadInput(f"--ranks-per-run: {ranks_per_run} — must be from 1 to {size}, the number of ranks")
    return ranks_per_run


def chosen_ranks(requested: str, scene: Scene, size: int) -> int:
    """Return how many ranks compute a run together: as many as are requested, or as pay off.

    Parameters
    ----------
    requested : str
        A number, or ``auto``.
    scene : Scene
        That is run.
    size : int
        How many ranks there are.

    Returns
    -------
    int
        From 1 to `size`.

    Raises
    ------
    BadInput
        If it is neither, or not possible.
    """
    if requested == AUTOMATIC:
        return recommended_ranks(scene, size)
    try:
        number = int(requested)
    except ValueError:
        raise BadInput(f"--ranks-per-run: {requested!r} — must be a number of ranks or {AUTOMATIC}") from None
    return checked_ranks(number, size)
