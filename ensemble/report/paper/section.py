"""What a section of the paper's report is, and what it may ask for and must give."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from ensemble.report.paper.case import Case, StudyCase
from ensemble.report.paper.comparison import Row
from ensemble.report.paper.results import Results


@dataclass(frozen=True)
class SectionPlan:
    """Runs and boundaries that a section needs next."""

    cases: Sequence[Case] = ()
    studies: Sequence[StudyCase] = ()


@dataclass(frozen=True)
class Drawing:
    """A figure, with its name (also that of its files), a caption and the command behind it.

    Without a command it is the one that makes the section.
    """

    name: str
    caption: str
    figure: Figure
    command: str = ""


@dataclass(frozen=True)
class Chapter:
    """What a section has to say, in this order: Markdown, comparisons and figures."""

    content: Sequence[str | Sequence[Row] | Drawing]


Course = Generator[SectionPlan, Results, Chapter]


@dataclass(frozen=True)
class Section:
    """A section of the report.

    Parameters
    ----------
    name : str
        As in ``--only`` and in the names of its figures.
    title : str
    course : callable
        Takes whether the report is to be quick.  The generator that it returns yields plans; each time it
        gets the results of everything planned so far.  It ends by returning its chapter.
    """

    name: str
    title: str
    course: Callable[[bool], Course]
