"""Makes the report on the paper on all ranks and writes it into the store."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from ensemble.display.progress import progress_text
from ensemble.mpi.run_study import Snapshot, run_batch, run_study
from ensemble.mpi.store_on_ranks import whole_store
from ensemble.report import ReportName, report_directory
from ensemble.report.paper.comparison import Comparison
from ensemble.report.paper.paper_document import Paper, PaperSection, ReportFigure
from ensemble.report.paper.paper_text import paper_conclusions, paper_text
from ensemble.report.paper.results import Results
from ensemble.report.paper.section import Section, SectionContent, SectionFigure, SectionPlan
from ensemble.report.report_files import FinishedReport, write_report
from ensemble.report.report_model import Machine

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from ensemble.mpi.store_on_ranks import StoreOnRank


def make_paper(
    communicator: Intracomm,
    store: StoreOnRank,
    sections: Sequence[Section],
    quick: bool,
    log: Callable[[str], None],
    ranks_per_run: int = 1,
) -> FinishedReport | None:
    """Make the runs that the store does not have, then write ``reports/paper/`` in the store.

    Collective.  The files are ``report.md``, ``report.html``, ``report.json`` and the figures, as PNG and as
    SVG; each appears complete or not at all.

    Parameters
    ----------
    communicator : Intracomm
        All ranks.
    store : Store or RunStaging
        From `store_on_ranks`.
    sections : sequence of Section
        The sections to make.
    quick : bool
        Make fewer runs: minutes instead of an hour.
    log : callable
        Called on rank 0 with one line of text whenever a run has been made.
    ranks_per_run : int
        How many ranks compute a run together.

    Returns
    -------
    FinishedReport or None
        The report on rank 0; None elsewhere.
    """
    begin, runs = time.perf_counter(), 0
    generators = (
        _SectionGenerators(sections, Results(whole_store(store)), quick)
        if communicator.Get_rank() == 0
        else None
    )
    while (plan := communicator.bcast(generators.next_plan() if generators else None)) is not None:
        runs += _make_runs(communicator, plan, store, log, ranks_per_run)
    if generators is None:
        return None
    parts: list[PaperSection] = []
    figures: dict[str, Figure] = {}
    for section in sections:
        part, section_figures = _part(section, generators.contents[section.name])
        parts.append(part)
        figures |= section_figures
    paper = Paper(
        quick=quick,
        machine=Machine.here(),
        ranks=communicator.Get_size(),
        runs=runs,
        wall_seconds=time.perf_counter() - begin,
        parts=parts,
    )
    directory = report_directory(whole_store(store).path, ReportName.PAPER)
    report = FinishedReport(directory, paper, paper_text(paper), paper_conclusions(paper))
    write_report(report, figures)
    return report


class _SectionGenerators:
    """Takes the generators of all sections, on rank 0, from their first plan to their content.

    Attributes
    ----------
    contents : dict of str to SectionContent
        The content of each section that is finished, by the name of the section.
    """

    def __init__(self, sections: Sequence[Section], results: Results, quick: bool) -> None:
        self._results = results
        self._unfinished = {section.name: section.generate(quick) for section in sections}
        self._first_plans = {name: next(generator) for name, generator in self._unfinished.items()}
        self.contents: dict[str, SectionContent] = {}

    def next_plan(self) -> SectionPlan | None:
        """Return what all sections need next; None if all are finished.

        Each call but the first assumes that the plan before has been carried out.
        """
        if not self._unfinished:
            return None
        plans, self._first_plans = self._first_plans, {}
        if not plans:
            for name, generator in tuple(self._unfinished.items()):
                try:
                    plans[name] = generator.send(self._results)
                except StopIteration as finished:
                    self.contents[name] = finished.value
                    del self._unfinished[name]
        cases = {case.key: case for plan in plans.values() for case in plan.cases}
        studies = {case.study.key: case for plan in plans.values() for case in plan.studies}
        return SectionPlan(tuple(cases.values()), tuple(studies.values())) if plans else None


def _make_runs(
    communicator: Intracomm,
    plan: SectionPlan,
    store: StoreOnRank,
    log: Callable[[str], None],
    ranks_per_run: int,
) -> int:
    """Make the runs of a plan on all ranks, and return how many they are."""
    usage = run_batch(
        communicator,
        [case.scene for case in plan.cases],
        store,
        lambda progress: log(f"runs: {progress_text(progress)}"),
        ranks_per_run,
    )
    runs = usage.runs
    for case in plan.studies:
        show = _progress_logger(case.study.name, log)
        runs += run_study(communicator, case.study, store, show, ranks_per_run).usage.runs
    return runs


def _progress_logger(name: str, log: Callable[[str], None]) -> Callable[[Snapshot], None]:
    return lambda snapshot: log(f"{name}: {progress_text(snapshot.progress)}")


def _part(section: Section, section_content: SectionContent) -> tuple[PaperSection, dict[str, Figure]]:
    """Return a section as data, and its figures by the names of their files."""
    content: list[str | list[Comparison] | ReportFigure] = []
    figures = {}
    for block in section_content.blocks:
        match block:
            case str():
                content.append(block)
            case SectionFigure():
                name = f"{section.name}-{block.name}"
                figures[name] = block.figure
                command = block.command or f"ensemble report {ReportName.PAPER} --only {section.name}"
                content.append(ReportFigure(name=name, caption=block.caption, command=command))
            case _:
                content.append(list(block))
    return PaperSection(name=section.name, title=section.title, content=content), figures
