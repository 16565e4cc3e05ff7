"""Tables of reports as Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ensemble.report.report_model import Machine, ReportModel

_ABSENT = "–"


def table(columns: Mapping[str, str], documents: Sequence[ReportModel]) -> str:
    """Return a Markdown table with one row for each document.

    Parameters
    ----------
    columns : mapping of str to str
        For each heading, the field that stands below it.
    documents : sequence of ReportModel
        The rows.

    Returns
    -------
    str
        The table; a dash stands for None.
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


def bullets(sentences: Sequence[str]) -> str:
    """Return sentences as a Markdown list.

    Parameters
    ----------
    sentences : sequence of str
        The sentences.

    Returns
    -------
    str
        One line for each.
    """
    return "\n".join(f"- {sentence}" for sentence in sentences)


def made_on(machine: Machine) -> str:
    """Return a sentence on how the times of a report were measured.

    Parameters
    ----------
    machine : Machine
        The computer that made the report.

    Returns
    -------
    str
        One paragraph.
    """
    return (
        f"Made on: {machine.sentence()}.  A single thread makes all runs, one after the other; compilation "
        "is not timed.  A run that was already in the store keeps the time it took then."
    )


def image_links(files: Sequence[str]) -> list[str]:
    """Return Markdown that shows image files.

    Parameters
    ----------
    files : sequence of str
        Names of the files, in the directory of the report.

    Returns
    -------
    list of str
        One paragraph for each file.
    """
    return [f"![{name}]({name})" for name in files]
