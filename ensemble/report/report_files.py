"""The files of a report, in the store."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from ensemble.disk import replacing
from ensemble.figures import save
from ensemble.report import PAGE
from ensemble.report.report_model import ReportModel
from ensemble.report.report_page import report_page


@dataclass(frozen=True)
class FinishedReport:
    """A finished report.

    Attributes
    ----------
    directory : Path
        Where its files are.
    document : ReportModel
        The report as data.
    text : str
        The report as Markdown, which begins with the conclusions.
    conclusions : sequence of str
        What it comes to: a sentence each, ten at most.
    """

    directory: Path
    document: ReportModel
    text: str
    conclusions: Sequence[str]


def write_report(report: FinishedReport, figures: Mapping[str, Figure]) -> None:
    """Write the files of a report; each appears complete or not at all.

    Parameters
    ----------
    report : FinishedReport
        Its text becomes ``report.md`` and ``report.html``, its document ``report.json``.
    figures : mapping of str to Figure
        Figures by name; each becomes ``<name>.png`` and ``<name>.svg``.
    """
    report.directory.mkdir(parents=True, exist_ok=True)
    for name, figure in figures.items():
        for suffix in (".png", ".svg"):
            save(figure, report.directory / f"{name}{suffix}")
    data = report.document.model_dump_json(indent=2)
    page = report_page(report.text, report.directory)
    texts = {"report.json": data, "report.md": report.text, PAGE: page}
    for name, content in texts.items():
        with replacing(report.directory / name) as unfinished:
            unfinished.write_text(content, encoding="utf-8")
