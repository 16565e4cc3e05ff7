"""A world of ranks as groups, each of which computes one run at a time together.

The first rank of a group is its leader: it alone talks to the dispatcher, stages results and decides whether
a run goes on; the others follow it.  The last group is smaller where the ranks do not divide evenly, so no
rank is left over.
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
        """Split a communicator into groups of this many neighboring ranks.

        Collective.

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
    """Return the communicator of all ranks of the same color, in the same order; None without a color.

    Collective.
    """
    from mpi4py import MPI

    part = communicator.Split(MPI.UNDEFINED if color is None else color, communicator.Get_rank())
    return None if color is None else cast("Intracomm", part)


def checked_ranks(ranks_per_run: int, size: int) -> int:
    """Return the number of ranks for a run, if it is possible.

    Raises
    ------
    BadInput
        If it is not between 1 and the number of ranks.
    """
    if not 1 <= ranks_per_run <= size:
        raise BadInput(f"--ranks-per-run: {ranks_per_run} — must be from 1 to {size}, the number of ranks")
    return ranks_per_run


def chosen_ranks(asked: str, scene: Scene, size: int) -> int:
    """Return how many of ``size`` ranks compute a run together: what is asked for, or what pays off.

    Parameters
    ----------
    asked : str
        A number, or ``auto``.
    scene : Scene
        That is run.
    size : int

    Raises
    ------
    BadInput
        If it is neither, or not possible.
    """
    if asked == AUTOMATIC:
        return recommended_ranks(scene, size)
    try:
        number = int(asked)
    except ValueError:
        raise BadInput(f"--ranks-per-run: {asked!r} — must be a number of ranks or {AUTOMATIC}") from None
    return checked_ranks(number, size)
