"""What a section of the paper's report is: what it may ask for, and what it returns."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from ensemble.report.paper.case import Case, StudyCase
from ensemble.report.paper.comparison import Comparison
from ensemble.report.paper.results import Results


@dataclass(frozen=True)
class SectionPlan:
    """Runs and boundaries that a section needs next.

    Attributes
    ----------
    cases : sequence of Case
        The runs.
    studies : sequence of StudyCase
        The boundaries.
    """

    cases: Sequence[Case] = ()
    studies: Sequence[StudyCase] = ()


@dataclass(frozen=True)
class SectionFigure:
    """A figure of a section.

    Attributes
    ----------
    name : str
        Its name in the section, and in the names of its files.
    caption : str
        Its caption, in Markdown.
    figure : Figure
        What is drawn.
    command : str
        Command that computes what is drawn; if empty, the command that makes the section.
    """

    name: str
    caption: str
    figure: Figure
    command: str = ""


@dataclass(frozen=True)
class SectionContent:
    """What a section shows.

    Attributes
    ----------
    blocks : sequence of str, sequence of Comparison or SectionFigure
        Paragraphs in Markdown, tables of comparisons, and figures, in their order.
    """

    blocks: Sequence[str | Sequence[Comparison] | SectionFigure]


SectionGenerator = Generator[SectionPlan, Results, SectionContent]


@dataclass(frozen=True)
class Section:
    """A section of the report.

    Attributes
    ----------
    name : str
        Its name in ``--only`` and in the names of its figures.
    title : str
        Its heading.
    generate : callable
        Takes one argument, whether the report is to be quick, and returns a generator.  The generator
        yields plans; after each it receives the results of everything planned so far.  It ends by returning
        the content of the section.
    """

    name: str
    title: str
    generate: Callable[[bool], SectionGenerator]
