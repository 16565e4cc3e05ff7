"""Doublets in shear as the report asks for them."""

from __future__ import annotations

from typing import Any, NamedTuple

from ensemble.report.paper.case import Case
from ensemble.report.paper.published import published
from ensemble.report.paper.results import Results

RATE, DISTANCE = 0.5, 0.4  # unless they are varied

_UNREACHED = 1000  # revolutions


class Doublet(NamedTuple):
    """What is varied; the vesicles are those of the published runs, or have reduced area 0.9 exactly."""

    hamaker: float
    rate: float = RATE
    distance: float = DISTANCE
    as_published: bool = False

    @property
    def case(self) -> Case:
        """Followed for two turns, or until it separates."""
        return Case.of("doublet-shear", self._changes)

    @property
    def until_published_horizon(self) -> Case:
        """Followed until the published runs end, however often it has turned."""
        horizon = published()["settings"]["horizon"]
        return self.case.but(
            {"horizon": horizon, "criteria.extensions": 1.0, "criteria.revolutions": _UNREACHED}
        )

    @property
    def _changes(self) -> dict[str, Any]:
        changes: dict[str, Any] = {
            "adhesion.hamaker": self.hamaker,
            "flow.rate": self.rate,
            "adhesion.distance": self.distance,
        }
        return changes | (published_vesicles() if self.as_published else {})


def published_vesicles() -> dict[str, float]:
    """The changes that make vesicles those of the published runs called 0.90."""
    settings = published()["settings"]
    return {f"vesicles.{name}": settings[name] for name in ("reduced_area", "length")}


def period(results: Results, doublet: Doublet) -> float | None:
    """Duration of the last full turn, None if there was none."""
    return results.summary(doublet.case).period
