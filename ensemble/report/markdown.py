"""Reports as Markdown for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ensemble.report.answers import SHEAR_RATE
from ensemble.report.machine import Machine
from ensemble.report.report_model import Document
from ensemble.report.stability import Stability, StabilityVerdict
from ensemble.report.work_precision import FLOOR, WorkPrecision

_ABSENT = "–"

# Columns of the tables: headings, and the fields under them.
_REFERENCE = {
    "scene": "scene",
    "N": "points",
    "tolerance": "tolerance",
    "uncertainty": "uncertainty",
    "seconds": "wall_seconds",
}
_SLOPE = {"scene": "scene", "method": "method", "N": "points", "order": "order", "points fitted": "fitted"}
_ENVELOPE = {
    "scene": "scene",
    "error": "error",
    "fastest": "fastest",
    "its seconds": "fastest_seconds",
    "default": "default",
    "seconds of the default": "default_seconds",
    "default / fastest": "slowdown",
    "SDC of order 2 / default": "speedup",
}
_MEASUREMENT = {
    "scene": "scene",
    "method": "method",
    "N": "points",
    "tolerance": "tolerance",
    "RMS error": "error_rms",
    "largest error": "error_max",
    "seconds": "wall_seconds",
    "evaluations": "evaluations",
    "steps": "steps",
    "failure": "failure",
}
_ANSWER = {
    "method": "method",
    "N": "points",
    "tolerance": "tolerance",
    "period": "period",
    "error of the period": "period_error",
    "viscosity": "viscosity",
    "error of the viscosity": "viscosity_error",
    "seconds": "wall_seconds",
    "evaluations": "evaluations",
    "failure": "failure",
}
_CRITICAL = {
    "tolerance": "tolerance",
    "bracket": "bracket",
    "status": "status",
    "runs": "runs",
    "seconds": "wall_seconds",
}
_ROW = {
    "scene": "scene",
    "verdict": "verdict",
    "reason": "reason",
    "outcome": "outcome",
    "time": "time",
    "area error": "area_error",
    "closure error": "closure_error",
    "temporal error": "temporal_error",
    "spatial error": "spatial_error",
    "smallest gap": "smallest_gap",
    "energy rise": "energy_rise",
    "smallest step": "smallest_step",
    "steps": "steps",
    "evaluations": "evaluations",
    "seconds": "wall_seconds",
}


def table(columns: Mapping[str, str], documents: Sequence[Document]) -> str:
    """Return a Markdown table, a row for each document; None is a dash.

    Parameters
    ----------
    columns : mapping from heading to field
    documents : sequence of Document
    """
    rows = [[_cell(getattr(document, field)) for field in columns.values()] for document in documents]
    return "\n".join("| " + " | ".join(line) + " |" for line in [columns, ["---"] * len(columns), *rows])


def _cell(value: Any) -> str:
    if value is None or value == "":
        return _ABSENT
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, tuple):
        return " to ".join(map(_cell, value))
    return str(value).replace("|", "\\|")


def _made_on(machine: Machine) -> str:
    return (
        f"Made on: {machine.sentence()}.  All runs are made by a single thread, one after the other; "
        "compiling is not timed.  A run that the store had already keeps the time it took then."
    )


def work_precision_text(report: WorkPrecision, figures: Sequence[str]) -> str:
    """Return the work-precision report, with figures in these files."""
    sections = [
        "# Work and precision",
        _made_on(report.machine),
        "The error of a position is the distance of a membrane's points, at the final time, to the converged "
        "run's membrane.  Points glide along a membrane by a choice without physics in it, so shapes are "
        "compared and not points.",
        *(f"![{name}]({name})" for name in figures),
        "## Converged runs",
        "*Uncertainty* is the largest distance of a slightly coarser run from the converged one: smaller "
        "errors below say nothing.",
        table(_REFERENCE, report.references),
        "## Observed orders",
        "Error ∝ evaluations^(−order), a least-squares fit over the tolerances.  Left out are errors at most "
        f"{FLOOR:g} times the least one at the same N, where the error in space shows.",
        table(_SLOPE, report.slopes),
        "## Least time to an error",
        "The least time in which a run came within this error, at whatever tolerance and number of points: "
        "by the fastest method, by the default one, and beside spectral deferred correction of order 2.",
        table(_ENVELOPE, report.envelopes),
        "## Position error",
        table(_MEASUREMENT, report.measurements),
        "## Answers: period and intrinsic viscosity of the doublet in shear",
        "Relative errors, against a converged run.",
        table(_ANSWER, report.answers),
    ]
    if report.critical_values:
        sections += [
            f"## Answers: critical adhesion strength at shear rate {SHEAR_RATE:g}",
            "Brackets from searches whose runs had this tolerance; the seconds are those of all runs.",
            table(_CRITICAL, report.critical_values),
        ]
    return "\n\n".join(sections) + "\n"


def stability_text(report: Stability, figures: Sequence[str]) -> str:
    """Return the stability report, with figures in these files."""
    counts = {verdict: sum(row.verdict is verdict for row in report.rows) for verdict in StabilityVerdict}
    sections = [
        "# Stiff and extreme scenes",
        _made_on(report.machine),
        f"{len(report.rows)} scenes: " + ", ".join(f"{count} {verdict}" for verdict, count in counts.items()),
        *(f"![{name}]({name})" for name in figures),
        "## Verdicts",
        "The first of these that holds:",
        "\n".join(f"- **{verdict}**: {criterion}" for verdict, criterion in report.criteria.items()),
    ]
    for group in dict.fromkeys(row.group for row in report.rows):
        rows = [row for row in report.rows if row.group == group]
        sections += [f"## {group.capitalize()}", table(_ROW, rows)]
    return "\n\n".join(sections) + "\n"
