"""The command that makes reports."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ensemble.cli.options import AsJson, RanksPerRun, StorePath
from ensemble.cli.printing import print_json
from ensemble.config.defaults import DEFAULT_STORE
from ensemble.errors import BadInput, refusing
from ensemble.mpi.world import launched_rank
from ensemble.report import PAGE, ReportName

if TYPE_CHECKING:
    from ensemble.report.report_files import FinishedReport
    from ensemble.store import Store


def report(  # numpydoc ignore=PR01
    name: Annotated[ReportName, typer.Argument(help="What to report.")],
    quick: Annotated[bool, typer.Option("--quick", help="Minutes instead of hours.")] = False,
    only: Annotated[
        list[str], typer.Option(metavar="SECTION", help="Of the paper, only this section.  Repeatable.")
    ] = [],  # noqa: B006  typer copies it
    ranks_per_run: RanksPerRun = None,
    store: StorePath = DEFAULT_STORE,
    as_json: AsJson = False,
) -> None:
    """Measure the solver (errors, extreme scenes, scaling over all ranks), or recompute the paper.

    The report is written into the store, which keeps its runs too: only what is missing is run.  What it
    comes to is printed, in ten lines at most.
    """
    if only and name is not ReportName.PAPER:
        raise BadInput(f"--only: the report {name} has no sections")
    if ranks_per_run is not None and name is not ReportName.PAPER:
        raise BadInput(f"--ranks-per-run: the report {name} chooses the ranks of its runs itself")
    if name is ReportName.PAPER:
        made = _paper(only, quick, store, ranks_per_run)
    elif name is ReportName.SCALING:
        made = _scaling(quick, store)
    else:
        made = _measurements(name, quick, store)
    if made is None:
        return
    if as_json:
        print_json(made.document.model_dump(mode="json"))
    else:
        print("\n".join([*made.conclusions, f"The whole report: {made.directory / PAGE}"]))


def _paper(only: list[str], quick: bool, store: Path, ranks_per_run: str | None) -> FinishedReport | None:
    """Make the paper's report on all ranks; None on all but the first."""
    from rich.console import Console

    from ensemble.config.documents import load_scene
    from ensemble.display.progress import report_progress
    from ensemble.mpi.groups import chosen_ranks
    from ensemble.mpi.store_on_ranks import store_on_ranks
    from ensemble.mpi.world import abort_guard, world
    from ensemble.report.paper.make_paper import make_paper
    from ensemble.report.paper.sections import sections_named

    with refusing():
        sections = sections_named(only)
    communicator = world()
    with abort_guard(communicator):
        # Its scenes have one vesicle or two.
        ranks = chosen_ranks(ranks_per_run or "1", load_scene("doublet-shear"), communicator.Get_size())
        with (
            store_on_ranks(communicator, store, ReportName.PAPER) as opened,
            report_progress(Console(stderr=True)) as log,
        ):
            return make_paper(communicator, opened, sections, quick, log, ranks)


def _scaling(quick: bool, store: Path) -> FinishedReport | None:
    """Make the report on scaling on all ranks; None on all but the first."""
    from rich.console import Console

    from ensemble.display.progress import report_progress
    from ensemble.mpi.store_on_ranks import store_on_ranks
    from ensemble.mpi.world import abort_guard, world
    from ensemble.report.scaling.make_scaling import make_scaling

    communicator = world()
    with (
        abort_guard(communicator),
        store_on_ranks(communicator, store, ReportName.SCALING) as opened,
        report_progress(Console(stderr=True)) as log,
    ):
        return make_scaling(communicator, opened, quick, log)


def _measurements(name: ReportName, quick: bool, store: Path) -> FinishedReport | None:
    """Measure the solver on the first rank alone: nothing else may disturb the time that runs take."""
    if launched_rank() != 0:
        return None
    from rich.console import Console

    from ensemble.display.progress import report_progress
    from ensemble.report.stability.make_stability import make_stability
    from ensemble.report.work_precision.make_work_precision import make_work_precision

    with ExitStack() as stack:
        with refusing():
            opened = stack.enter_context(_opened(store, name))
        make = make_stability if name is ReportName.STABILITY else make_work_precision
        return make(opened, quick, stack.enter_context(report_progress(Console(stderr=True))))


def _opened(path: Path, report: ReportName) -> Store:
    from ensemble.store import Store

    return Store.open(path, report)
