"""The adhesion between different vesicles, as a scene describes it."""

from __future__ import annotations

from typing import Self

from pydantic import model_validator

from solver.model import Model, NonNegative, Positive


class Adhesion(Model):
    """Potential H[(δ/r)^m − (m/n)(δ/r)^n] between points of different vesicles (paper, eq. 2)."""

    hamaker: NonNegative
    distance: Positive
    exponents: tuple[int, int] = (4, 2)
    cutoff: Positive | None = None  # distance beyond which points do not attract; None: they always do

    @model_validator(mode="after")
    def _ordered_exponents(self) -> Self:
        m, n = self.exponents
        if not m > n >= 2:
            raise ValueError(f"exponents must be integers m > n >= 2, got [{m}, {n}]")
        return self

    @model_validator(mode="after")
    def _cutoff_beyond_the_repulsion(self) -> Self:
        if self.cutoff is not None and self.cutoff <= self.distance:
            raise ValueError(f"cutoff must be more than the distance {self.distance}, got {self.cutoff}")
        return self
