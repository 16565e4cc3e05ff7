"""A rate that jumps."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from solver.dimensions import TIME
from solver.model import NonNegative, Positive
from solver.protocols.rate_protocol import Piece, RateProtocol

_MOST = 10_000


class Steps(RateProtocol):
    """The rate is a constant multiple of the flow's rate between one time and the next.

    Attributes
    ----------
    times : tuple of float
        Times at which the rate jumps, in ascending order.
    factors : tuple of float
        Multiples of the flow's rate: one up to the first time, and one from each time on.
    """

    kind: Literal["steps"] = "steps"
    times: tuple[Annotated[Positive, TIME], ...] = Field(min_length=1, max_length=_MOST)
    factors: tuple[NonNegative, ...] = Field(min_length=2, max_length=_MOST + 1)

    title: ClassVar[str] = "with steps of the rate"

    @model_validator(mode="after")
    def _one_factor_between_any_two_times(self) -> Self:
        if any(later <= earlier for earlier, later in pairwise(self.times)):
            raise ValueError(f"times must ascend, got {list(self.times)}")
        if len(self.factors) != len(self.times) + 1:
            raise ValueError(
                f"factors must be one more than times, {len(self.times) + 1}, got {len(self.factors)}"
            )
        return self

    @property
    def pieces(self) -> tuple[Piece, ...]:
        """One for each factor."""
        return tuple(map(Piece.line, (0.0, *self.times), self.factors))

    def largest(self, horizon: float) -> float:
        """Return the largest factor; see `RateProtocol`.

        Parameters
        ----------
        horizon : float

        Returns
        -------
        float
        """
        return max(self.factors[: self.last_piece(horizon) + 1])
