"""What every protocol states about itself.

A protocol is a factor of the flow's rate that is smooth but for a few times.  Steps end there.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_left, bisect_right
from collections.abc import Callable
from itertools import accumulate, pairwise
from math import inf
from typing import ClassVar, NamedTuple, Self

from solver.model import Model


class Piece(NamedTuple):
    """A smooth part of a protocol; its functions take times, beyond its end as well.

    Attributes
    ----------
    start : float
        When it begins; it ends where the next one begins.
    factor, slope : callable
        The factor, and its derivative by time.
    integral : callable
        Of the factor since the start, in units of time.
    constant : float or None
        The factor if it does not change.
    """

    start: float
    factor: Callable[[float], float]
    slope: Callable[[float], float]
    integral: Callable[[float], float]
    constant: float | None = None

    @classmethod
    def line(cls, start: float, factor: float, slope: float = 0.0) -> Self:
        """Return a piece in which the factor changes at the same speed all the time.

        Parameters
        ----------
        start : float
        factor : float
            At the start.
        slope : float

        Returns
        -------
        Piece
        """
        return cls(
            start,
            lambda time: factor + slope * (time - start),
            lambda time: slope,
            lambda time: (time - start) * (factor + 0.5 * slope * (time - start)),
            factor if slope == 0 else None,
        )


class Course(NamedTuple):
    """The pieces of a protocol, built once, to look times up in.

    Attributes
    ----------
    pieces : tuple of Piece
    breaks : tuple of float
        When each but the first one begins.
    integrals : tuple of float
        Of the factor from 0 to the start of each.
    """

    pieces: tuple[Piece, ...]
    breaks: tuple[float, ...]
    integrals: tuple[float, ...]

    @classmethod
    def of(cls, pieces: tuple[Piece, ...]) -> Self:
        """Return the course with these pieces.

        Parameters
        ----------
        pieces : tuple of Piece

        Returns
        -------
        Course
        """
        breaks = tuple(piece.start for piece in pieces[1:])
        whole = (piece.integral(following.start) for piece, following in pairwise(pieces))
        return cls(pieces, breaks, tuple(accumulate(whole, initial=0.0)))


class RateProtocol(Model, ABC):
    """A factor of the flow's rate that depends on time.

    Attributes
    ----------
    kind : str
        Which protocol it is.
    title : str
        The protocol in the words of a caption: "shear flow, …".
    time_scale : str or None
        Name of the field that says in which time the rate changes smoothly; a scene refuses values that are
        too short beside its horizon.  None if the rate changes at breaks alone.
    """

    # No field and not in the dictionary, so that neither copies with changes nor other ranks get it.
    __slots__ = ("_course",)

    kind: str

    title: ClassVar[str]
    time_scale: ClassVar[str | None] = None

    @property
    @abstractmethod
    def pieces(self) -> tuple[Piece, ...]:
        """The smooth parts in their order, the first one from time 0 on."""

    @abstractmethod
    def largest(self, horizon: float) -> float:
        """Return the largest magnitude of the factor before the horizon, or a bound of it.

        Parameters
        ----------
        horizon : float

        Returns
        -------
        float
        """

    @property
    def course(self) -> Course:
        """The pieces to look times up in; steps ask for it all the time."""
        course: Course | None = getattr(self, "_course", None)
        if course is None:
            course = Course.of(self.pieces)
            object.__setattr__(self, "_course", course)
        return course

    @property
    def breaks(self) -> tuple[float, ...]:
        """The times at which the factor or its slope jumps, in ascending order."""
        return self.course.breaks

    def next_break(self, time: float) -> float:
        """Return the first break after a time.

        Parameters
        ----------
        time : float

        Returns
        -------
        float
            Infinite after the last one.
        """
        index = self.piece_at(time)
        return self.breaks[index] if index < len(self.breaks) else inf

    def last_piece(self, horizon: float) -> int:
        """Return the index of the piece in which a run ends: breaks at the horizon or later play no part.

        Parameters
        ----------
        horizon : float

        Returns
        -------
        int
        """
        return bisect_left(self.breaks, horizon)

    def piece_at(self, time: float) -> int:
        """Return the index of the piece in which a time is, at a break that of the one that begins.

        Parameters
        ----------
        time : float

        Returns
        -------
        int
        """
        return bisect_right(self.breaks, time)

    def factor(self, time: float) -> float:
        """Return the factor at a time, at a break that from then on.

        Parameters
        ----------
        time : float

        Returns
        -------
        float
        """
        return self.course.pieces[self.piece_at(time)].factor(time)

    def integral(self, time: float) -> float:
        """Return the integral of the factor from 0 to a time.

        Parameters
        ----------
        time : float

        Returns
        -------
        float
            In units of time.
        """
        index = self.piece_at(time)
        return self.course.integrals[index] + self.course.pieces[index].integral(time)
