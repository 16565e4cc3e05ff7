"""The JSON documents of the command line."""

from __future__ import annotations

from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any

from ensemble.store.run_record import RunSummary

if TYPE_CHECKING:
    from ensemble.mpi.run_study import StudyResult

_WORK = ("points", "steps", "rejected_steps", "rhs_evaluations", "wall_seconds")
_RESULTS = (
    "outcome",
    "failure",
    "time",
    "period",
    "effective_aspect_ratio",
    "inclination_angle",
    "gap",
    "viscosity",
    "energy",
    "error",
)


def run_document(summary: RunSummary) -> dict[str, Any]:
    """Results and cost of a run; a quantity that its scene does not have is None."""
    document = summary.document()
    return (
        {name: document[name] for name in _RESULTS}
        | {name: document["work"][name] for name in _WORK}
        | {"run_key": summary.key}
    )


def study_document(traced: StudyResult, store: Path) -> dict[str, Any]:
    """A traced boundary and what it cost; `busy_fraction` is None when nothing had to be run."""
    cost = traced.cost
    return {
        "study": traced.boundary.name,
        "boundary": [point.model_dump(mode="json") for point in traced.boundary.points],
        "wall_seconds": cost.wall_seconds,
        "busy_fraction": fmean(cost.busy_fractions) if cost.busy_fractions else None,
        "store": str(store),
    }
