"""A rate that rises or falls evenly."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from solver.dimensions import TIME
from solver.model import NonNegative, Positive
from solver.protocols.rate_protocol import Piece, RateProtocol


class Ramp(RateProtocol):
    """The rate changes evenly from one multiple of the flow's rate to another one, and stays there.

    Attributes
    ----------
    start, end : float
        Rates before and after the change, as multiples of the flow's rate.
    begin : float
        Time at which the rate begins to change.
    duration : float
        Time that the change takes.
    """

    kind: Literal["ramp"] = "ramp"
    start: NonNegative = 0.0
    end: NonNegative = 1.0
    begin: Annotated[NonNegative, TIME] = 0.0
    duration: Annotated[Positive, TIME]

    title: ClassVar[str] = "with a ramp of the rate"
    time_scale: ClassVar[str] = "duration"

    @property
    def pieces(self) -> tuple[Piece, ...]:
        """Before, during and after the change."""
        slope = (self.end - self.start) / self.duration
        before = (Piece.line(0.0, self.start),) if self.begin > 0 else ()
        changing = Piece.line(self.begin, self.start, slope)
        return (*before, changing, Piece.line(self.begin + self.duration, self.end))

    def largest(self, horizon: float) -> float:
        """Return the larger one of start and end; see `RateProtocol`.

        Parameters
        ----------
        horizon : float

        Returns
        -------
        float
        """
        return max(self.start, self.end) if self.begin < horizon else self.start
