"""The report on the paper as data."""

from __future__ import annotations

from ensemble.report.paper.comparison import Comparison
from ensemble.report.report_model import Machine, ReportModel

Comparisons = list[Comparison]


class ReportFigure(ReportModel):
    """A figure; its files are ``<name>.png`` and ``<name>.svg``.

    Attributes
    ----------
    name, caption : str
        Name of the files, and caption in Markdown.
    command : str
        Command that computes what is drawn.
    """

    name: str
    caption: str
    command: str


class PaperSection(ReportModel):
    """A section of the report.

    Attributes
    ----------
    name, title : str
        Name and heading of the section.
    content : list of str, list of Comparison or ReportFigure
        Paragraphs in Markdown, tables of comparisons, and figures, in their order.
    """

    name: str
    title: str
    content: list[str | Comparisons | ReportFigure]

    @property
    def rows(self) -> Comparisons:
        """All comparisons of the section."""
        return [row for block in self.content if isinstance(block, list) for row in block]


class Paper(ReportModel):
    """The whole report.

    Attributes
    ----------
    report : str
        Name of the report.
    quick : bool
        Whether the report is thinned.
    machine : Machine
        The computer that made it.
    ranks : int
        Number of MPI ranks that made it.
    runs : int
        Runs that were made for it; those that were already in the store do not count.
    wall_seconds : float
        Time that it took.
    parts : list of PaperSection
        The sections, in their order.
    """

    report: str = "paper"
    quick: bool
    machine: Machine
    ranks: int
    runs: int
    wall_seconds: float
    parts: list[PaperSection]
