"""Makes the report on all ranks and writes it into the store."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from matplotlib.figure import Figure as Drawn

from ensemble.cli.progress import progress_text
from ensemble.mpi.run_study import Snapshot, run_batch, run_study
from ensemble.report import ReportName
from ensemble.report.files import Report, report_directory, write_report
from ensemble.report.machine import Machine
from ensemble.report.paper.paper_document import Figure, Paper, Part
from ensemble.report.paper.paper_text import paper_page, paper_text
from ensemble.report.paper.results import Results
from ensemble.report.paper.section import Chapter, Drawing, Section, SectionPlan
from ensemble.report.report_progress import Tell
from ensemble.store import Store

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm


def make_paper(
    communicator: Intracomm,
    store: Store,
    sections: Sequence[Section],
    quick: bool,
    tell: Tell,
    ranks_per_run: int = 1,
) -> Report | None:
    """Make the runs that the store does not have, then write ``reports/paper/`` in the store.

    Collective.  The files are ``report.md``, ``report.html``, ``report.json`` and the figures, as PNG and as
    SVG; each appears complete or not at all.

    Parameters
    ----------
    communicator : Intracomm
    store : Store
        The same on every rank.
    sections : sequence of Section
    quick : bool
        Minutes instead of an hour.
    tell : callable
        Takes a line about every run that has been made, on rank 0.
    ranks_per_run : int
        How many ranks compute a run together.

    Returns
    -------
    Report
        On rank 0; None elsewhere.
    """
    begin, runs = time.perf_counter(), 0
    courses = _Courses(sections, Results(store), quick) if communicator.Get_rank() == 0 else None
    while (plan := communicator.bcast(courses.next_plan() if courses else None)) is not None:
        runs += _carry_out(communicator, plan, store, tell, ranks_per_run)
    if courses is None:
        return None
    parts: list[Part] = []
    figures: dict[str, Drawn] = {}
    for section in sections:
        part, drawn = _part(section, courses.chapters[section.name])
        parts.append(part)
        figures |= drawn
    paper = Paper(
        quick=quick,
        machine=Machine.here(),
        ranks=communicator.Get_size(),
        runs=runs,
        wall_seconds=time.perf_counter() - begin,
        parts=parts,
    )
    report = Report(report_directory(store, ReportName.PAPER), paper, paper_text(paper))
    write_report(report, figures, {"report.html": paper_page(paper)})
    return report


class _Courses:
    """All sections on their way to their chapters, on rank 0.

    Attributes
    ----------
    chapters : dict
        Those that are finished, by the section's name.
    """

    def __init__(self, sections: Sequence[Section], results: Results, quick: bool) -> None:
        self._results = results
        self._going = {section.name: section.course(quick) for section in sections}
        self._plans = {name: next(course) for name, course in self._going.items()}
        self.chapters: dict[str, Chapter] = {}

    def next_plan(self) -> SectionPlan | None:
        """What all sections need next, once what they needed before is there; None when all are finished."""
        if not self._going:
            return None
        plans, self._plans = self._plans, {}
        if not plans:
            for name, course in tuple(self._going.items()):
                try:
                    plans[name] = course.send(self._results)
                except StopIteration as finished:
                    self.chapters[name] = finished.value
                    del self._going[name]
        cases = {case.key: case for plan in plans.values() for case in plan.cases}
        studies = {case.study.key: case for plan in plans.values() for case in plan.studies}
        return SectionPlan(tuple(cases.values()), tuple(studies.values())) if plans else None


def _carry_out(
    communicator: Intracomm, plan: SectionPlan, store: Store, tell: Tell, ranks_per_run: int
) -> int:
    """Make the runs of a plan on all ranks, and say how many."""
    cost = run_batch(
        communicator,
        [case.scene for case in plan.cases],
        store,
        lambda progress: tell(f"runs: {progress_text(progress)}"),
        ranks_per_run,
    )
    runs = cost.runs
    for case in plan.studies:
        telling = _telling(case.study.name, tell)
        runs += run_study(communicator, case.study, store, telling, ranks_per_run).cost.runs
    return runs


def _telling(name: str, tell: Tell) -> Callable[[Snapshot], None]:
    return lambda snapshot: tell(f"{name}: {progress_text(snapshot.progress)}")


def _part(section: Section, chapter: Chapter) -> tuple[Part, dict[str, Drawn]]:
    """The chapter as data, and its figures by the names of their files."""
    content: list[str | list | Figure] = []
    figures = {}
    for element in chapter.content:
        match element:
            case str():
                content.append(element)
            case Drawing():
                name = f"{section.name}-{element.name}"
                figures[name] = element.figure
                command = element.command or f"ensemble report {ReportName.PAPER} --only {section.name}"
                content.append(Figure(name=name, caption=element.caption, command=command))
            case _:
                content.append(list(element))
    return Part(name=section.name, title=section.title, content=content), figures
