"""A rate that does not change."""

from __future__ import annotations

from typing import ClassVar, Literal

from solver.protocols.rate_protocol import Piece, RateProtocol


class Constant(RateProtocol):
    """The rate of the flow all the time; a scene takes it as if no protocol were given."""

    kind: Literal["constant"] = "constant"

    title: ClassVar[str] = "at a constant rate"

    @property
    def pieces(self) -> tuple[Piece, ...]:
        """A single one."""
        return (Piece.line(0.0, 1.0),)

    def largest(self, horizon: float) -> float:
        """Return 1; see `RateProtocol`.

        Parameters
        ----------
        horizon : float

        Returns
        -------
        float
        """
        return 1.0
