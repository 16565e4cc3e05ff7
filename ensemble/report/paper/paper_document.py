"""The report as data."""

from __future__ import annotations

from ensemble.report.machine import Machine
from ensemble.report.paper.comparison import Row
from ensemble.report.report_model import Document

Rows = list[Row]


class Figure(Document):
    """A drawn figure: its files are ``<name>.png`` and ``<name>.svg``."""

    name: str
    caption: str
    command: str


class Part(Document):
    """A section: Markdown, comparisons and figures in their order."""

    name: str
    title: str
    content: list[str | Rows | Figure]

    @property
    def rows(self) -> Rows:
        """All lines of its comparisons."""
        return [row for element in self.content if isinstance(element, list) for row in element]


class Paper(Document):
    """The whole report.

    runs : made for it this time; those in the store before are not among them.
    wall_seconds : what it took this time, on `ranks` ranks.
    """

    report: str = "paper"
    quick: bool
    machine: Machine
    ranks: int
    runs: int
    wall_seconds: float
    parts: list[Part]
