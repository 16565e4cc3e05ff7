"""The files of a report, in the store."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from ensemble.disk import replacing
from ensemble.figures import save
from ensemble.report import ReportName
from ensemble.report.report_model import ReportModel
from ensemble.store import Store

_REPORTS = "reports"  # directory in the store


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


def report_directory(store: Store, name: ReportName) -> Path:
    """Return the directory that holds the files of a report.

    Parameters
    ----------
    store : Store
        The store that keeps the report.
    name : ReportName
        Name of the report.

    Returns
    -------
    Path
        ``reports/<name>`` in the store; it may not exist yet.
    """
    return store.path / _REPORTS / name


def write_report(
    report: FinishedReport, figures: Mapping[str, Figure], pages: Mapping[str, str] | None = None
) -> None:
    """Write the files of a report; each appears complete or not at all.

    Parameters
    ----------
    report : FinishedReport
        Its text becomes ``report.md``, its document ``report.json``.
    figures : mapping of str to Figure
        Figures by name; each becomes ``<name>.png`` and ``<name>.svg``.
    pages : mapping of str to str, optional
        Further texts by file name.
    """
    report.directory.mkdir(parents=True, exist_ok=True)
    for name, figure in figures.items():
        for suffix in (".png", ".svg"):
            save(figure, report.directory / f"{name}{suffix}")
    data = report.document.model_dump_json(indent=2)
    texts = {"report.json": data, "report.md": report.text} | dict(pages or {})
    for name, content in texts.items():
        with replacing(report.directory / name) as unfinished:
            unfinished.write_text(content, encoding="utf-8")
