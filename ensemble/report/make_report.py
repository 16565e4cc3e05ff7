"""Makes the reports that measure the solver, and writes them into the store."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from ensemble.report import ReportName
from ensemble.report.extremes import GROUPS
from ensemble.report.files import Report, report_directory, write_report
from ensemble.report.markdown import stability_text, work_precision_text
from ensemble.report.methods import FULL, QUICK
from ensemble.report.report_figures import error_figures, stability_figure
from ensemble.report.report_model import Document
from ensemble.report.report_progress import Tell
from ensemble.report.runs import Runs
from ensemble.report.scenes import SCENES
from ensemble.report.stability import quick_groups, stability
from ensemble.report.work_precision import work_precision
from ensemble.store import Store


def make_report(name: ReportName, store: Store, quick: bool, tell: Tell) -> Report:
    """Make the runs that the store does not have, then write ``reports/<name>/`` in the store.

    The files are ``report.md``, ``report.json`` and the figures, as PNG and as SVG; each appears complete or
    not at all.

    Parameters
    ----------
    name : ReportName
        One of those that measure the solver.
    store : Store
    quick : bool
        Minutes instead of hours: fewer scenes, resolutions and tolerances.
    tell : callable
        Takes a line about every run that is made.
    """
    runs = Runs(store, tell)
    document: Document
    if name is ReportName.WORK_PRECISION:
        document = errors = work_precision(runs, QUICK if quick else FULL, SCENES)
        figures = error_figures(errors)
        text = work_precision_text(errors, _drawings(figures))
    else:
        document = verdicts = stability(runs, quick_groups(GROUPS) if quick else GROUPS)
        figures = {"scenes": stability_figure(verdicts)}
        text = stability_text(verdicts, _drawings(figures))
    report = Report(report_directory(store, name), document, text)
    write_report(report, figures)
    return report


def _drawings(figures: Mapping[str, Figure]) -> list[str]:
    return [f"{name}.png" for name in figures]
