"""Makes the work-precision report and writes it into the store."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ensemble.report import ReportName, report_directory
from ensemble.report.report_files import FinishedReport, write_report
from ensemble.report.report_model import Machine
from ensemble.report.timed_runs import TimedRuns
from ensemble.report.work_precision.doublet_answers import critical_brackets, doublet_answers
from ensemble.report.work_precision.least_times import least_times
from ensemble.report.work_precision.observed_orders import observed_orders
from ensemble.report.work_precision.position_errors import measure_scene
from ensemble.report.work_precision.short_scenes import SHORT_SCENES
from ensemble.report.work_precision.work_precision_conclusions import work_precision_conclusions
from ensemble.report.work_precision.work_precision_document import WorkPrecision
from ensemble.report.work_precision.work_precision_figures import work_precision_figures
from ensemble.report.work_precision.work_precision_plan import FULL, QUICK, WorkPrecisionPlan
from ensemble.report.work_precision.work_precision_text import work_precision_text
from ensemble.store import Store
from solver.scene import Scene


def make_work_precision(store: Store, quick: bool, log: Callable[[str], None]) -> FinishedReport:
    """Make the runs that the store does not have, then write ``reports/work-precision/`` in the store.

    The files are ``report.md``, ``report.html``, ``report.json`` and the figures, as PNG and as
    SVG; each appears complete or not at all.

    Parameters
    ----------
    store : Store
        The store that keeps runs and report.
    quick : bool
        Make fewer resolutions and tolerances: minutes instead of hours.
    log : callable
        Called with one line of text before each run that is made.

    Returns
    -------
    FinishedReport
        The report.
    """
    document = measure_work_precision(TimedRuns(store, log), QUICK if quick else FULL, SHORT_SCENES)
    figures = work_precision_figures(document)
    text = work_precision_text(document, [f"{name}.png" for name in figures])
    directory = report_directory(store.path, ReportName.WORK_PRECISION)
    report = FinishedReport(directory, document, text, work_precision_conclusions(document))
    write_report(report, figures)
    return report


def measure_work_precision(
    runs: TimedRuns, plan: WorkPrecisionPlan, scenes: Mapping[str, Scene]
) -> WorkPrecision:
    """Measure every method in every scene, and the errors of what users ask for.

    Parameters
    ----------
    runs : TimedRuns
        Makes the runs.
    plan : WorkPrecisionPlan
        Methods, numbers of points and tolerances.
    scenes : mapping of str to Scene
        Scenes by name.  They must end at their horizon, whatever happens in them.

    Returns
    -------
    WorkPrecision
        The report as data.

    Raises
    ------
    ArithmeticError
        If a converged run fails.
    """
    references, measurements = [], []
    for name, scene in scenes.items():
        converged, measured = measure_scene(runs, plan, name, scene)
        references.append(converged)
        measurements += measured
    return WorkPrecision(
        machine=Machine.here(),
        references=references,
        measurements=measurements,
        slopes=observed_orders(measurements),
        envelopes=least_times(scenes, measurements),
        answers=doublet_answers(runs, plan),
        critical_values=critical_brackets(runs, plan),
    )
