"""Makes a report and writes it into the store."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from ensemble.figures import save
from ensemble.report import ReportName
from ensemble.report.document import Document
from ensemble.report.extremes import GROUPS
from ensemble.report.figures import error_figures, stability_figure
from ensemble.report.markdown import stability_text, work_precision_text
from ensemble.report.methods import FULL, QUICK
from ensemble.report.progress import Tell
from ensemble.report.runs import Runs
from ensemble.report.scenes import SCENES
from ensemble.report.stability import quick_groups, stability
from ensemble.report.work_precision import work_precision
from ensemble.store import Store

REPORTS = "reports"  # directory in the store


@dataclass(frozen=True)
class Report:
    """A finished report and the directory that holds its files."""

    directory: Path
    document: Document
    text: str


def make_report(name: ReportName, store: Store, quick: bool, tell: Tell) -> Report:
    """Make the runs that the store does not have, then write ``reports/<name>/`` in the store.

    The files are ``report.md``, ``report.json`` and the figures, as PNG and as SVG; each appears complete or
    not at all.

    Parameters
    ----------
    name : ReportName
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
    report = Report(store.path / REPORTS / name, document, text)
    _write(report, figures)
    return report


def _drawings(figures: Mapping[str, Figure]) -> list[str]:
    return [f"{name}.png" for name in figures]


def _write(report: Report, figures: Mapping[str, Figure]) -> None:
    report.directory.mkdir(parents=True, exist_ok=True)
    for name, figure in figures.items():
        for suffix in (".png", ".svg"):
            save(figure, report.directory / f"{name}{suffix}")
    _replace(report.directory / "report.json", report.document.model_dump_json(indent=2))
    _replace(report.directory / "report.md", report.text)


def _replace(path: Path, text: str) -> None:
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    unfinished.write_text(text, encoding="utf-8")
    unfinished.replace(path)
