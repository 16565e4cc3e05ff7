"""The work-precision report as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from ensemble.report.markdown_table import bullets, image_links, made_on, table
from ensemble.report.work_precision.doublet_answers import SHEAR_RATE
from ensemble.report.work_precision.observed_orders import FLOOR
from ensemble.report.work_precision.work_precision_conclusions import work_precision_conclusions
from ensemble.report.work_precision.work_precision_document import WorkPrecision

# Columns of the tables: headings, and the fields below them.
_CONVERGED_RUN = {
    "scene": "scene",
    "N": "points",
    "tolerance": "tolerance",
    "uncertainty": "uncertainty",
    "seconds": "wall_seconds",
}
_OBSERVED_ORDER = {
    "scene": "scene",
    "method": "method",
    "N": "points",
    "order": "order",
    "points fitted": "fitted",
}
_LEAST_TIME = {
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
    "reported": "error_reported",
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
    "reported": "period_reported",
    "viscosity": "viscosity",
    "error of the viscosity": "viscosity_error",
    "reported, too": "viscosity_reported",
    "seconds": "wall_seconds",
    "evaluations": "evaluations",
    "failure": "failure",
}
_CRITICAL_BRACKET = {
    "tolerance": "tolerance",
    "bracket": "bracket",
    "status": "status",
    "runs": "runs",
    "seconds": "wall_seconds",
}


def work_precision_text(report: WorkPrecision, figures: Sequence[str]) -> str:
    """Return the report as Markdown.

    Parameters
    ----------
    report : WorkPrecision
        The report as data.
    figures : sequence of str
        Names of the image files to show.

    Returns
    -------
    str
        The text.
    """
    sections = [
        "# Work and precision",
        bullets(work_precision_conclusions(report)),
        made_on(report.machine),
        "The error of a position is the distance of a membrane's points, at the final time, from the "
        "membrane of the converged run.  How points move along a membrane is a choice without physics in "
        "it, so shapes are compared and not points.",
        *image_links(figures),
        "## Converged runs",
        "*Uncertainty* is the largest distance of a slightly coarser run from the converged one.  Errors "
        "below it mean nothing.",
        table(_CONVERGED_RUN, report.references),
        "## Observed orders",
        "Error ∝ evaluations^(−order), a least-squares fit over the tolerances.  Errors of at most "
        f"{FLOOR:g} times the least one at the same N are left out: there the error in space shows.",
        table(_OBSERVED_ORDER, report.slopes),
        "## Least time to an error",
        "The least time in which a run reached this error, at whatever tolerance and number of points: with "
        "the fastest method, with the default one, and compared with spectral deferred correction of order "
        "2.",
        table(_LEAST_TIME, report.envelopes),
        "## Position error",
        table(_MEASUREMENT, report.measurements),
        "## Answers: period and intrinsic viscosity of the doublet in shear",
        "Relative errors, from a converged run, and beside them those that the run itself reports.",
        table(_ANSWER, report.answers),
    ]
    if report.critical_values:
        sections += [
            f"## Answers: critical Hamaker constant at shear rate {SHEAR_RATE:g}",
            "Brackets from searches whose runs had this tolerance; the seconds are those of all runs.",
            table(_CRITICAL_BRACKET, report.critical_values),
        ]
    return "\n\n".join(sections) + "\n"
