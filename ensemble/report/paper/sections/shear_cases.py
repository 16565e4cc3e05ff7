"""Runs of doublets in shear, for several sections."""

from __future__ import annotations

from typing import Any, NamedTuple

from ensemble.report.paper.case import Case
from ensemble.report.paper.comparison import published

RATE, DISTANCE = 0.5, 0.4  # where they are not varied

_UNREACHED = 1000  # revolutions


class ShearDoublet(NamedTuple):
    """Parameters of a doublet in shear that are varied.

    Attributes
    ----------
    hamaker, rate, distance : float
        Hamaker constant, shear rate and adhesion distance.
    as_published : bool
        Whether the vesicles are those of the published runs; else their reduced area is exactly 0.9.
    """

    hamaker: float
    rate: float = RATE
    distance: float = DISTANCE
    as_published: bool = False

    @property
    def case(self) -> Case:
        """The run that ends when the motion has settled, or when the pair separates."""
        return Case.of("doublet-shear", self._changes)

    @property
    def until_published_horizon(self) -> Case:
        """The run that ends when the published runs end, however often the pair has turned."""
        horizon = published()["settings"]["horizon"]
        return self.case.with_changes({"horizon": horizon, "criteria.revolutions": _UNREACHED})

    @property
    def _changes(self) -> dict[str, Any]:
        changes: dict[str, Any] = {
            "adhesion.hamaker": self.hamaker,
            "flow.rate": self.rate,
            "adhesion.distance": self.distance,
        }
        return changes | (published_vesicles() if self.as_published else {})


def published_vesicles() -> dict[str, float]:
    """Return the changes that make vesicles those of the published runs of nominal reduced area 0.90."""
    settings = published()["settings"]
    return {f"vesicles.{name}": settings[name] for name in ("reduced_area", "length")}
