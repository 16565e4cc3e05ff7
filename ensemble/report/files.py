"""The files of a report, in the store."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from ensemble.disk import replacing
from ensemble.figures import save
from ensemble.report import ReportName
from ensemble.report.report_model import Document
from ensemble.store import Store

_REPORTS = "reports"  # directory in the store


@dataclass(frozen=True)
class Report:
    """A finished report and the directory that holds its files."""

    directory: Path
    document: Document
    text: str


def report_directory(store: Store, name: ReportName) -> Path:
    """Where the files of a report are."""
    return store.path / _REPORTS / name


def write_report(
    report: Report, figures: Mapping[str, Figure], pages: Mapping[str, str] | None = None
) -> None:
    """Write the text, the data, further pages by name, and the figures as PNG and as SVG.

    Each file appears complete or not at all.
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
