"""The command line.

Every command imports what it needs when it is called: no command waits for libraries it does not use.
"""

from __future__ import annotations

import json
import sys
from contextlib import ExitStack
from enum import StrEnum
from importlib.metadata import entry_points
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ensemble.errors import BadInput, refusing
from ensemble.mpi.world import launched_rank, only_first_rank_speaks, pin_threads
from ensemble.report import ReportName

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm
    from rich.table import Table

    from ensemble.config.study import Study
    from ensemble.mpi.run_study import StudyResult
    from ensemble.mpi.usage import RunUsage
    from ensemble.report.report_files import FinishedReport
    from ensemble.search.boundary import Boundary
    from ensemble.store import Store

DEFAULT_STORE = Path("ensemble-store")
DEFAULT_STUDY = "critical-hamaker"
COMMANDS = "ensemble.commands"  # entry point group: functions that other packages add as commands

Changes = Annotated[
    list[str],
    typer.Option(
        "--set", metavar="PATH=VALUE", help="Change a field: dotted path and TOML value.  Repeatable."
    ),
]
StorePath = Annotated[Path, typer.Option("--store", metavar="DIR", help="Directory of the store.")]
Filters = Annotated[
    list[str],
    typer.Option(metavar="CONDITION", help="For example flow.rate>=0.5 or outcome=bound.  Repeatable."),
]
RanksPerRun = Annotated[
    str | None,
    typer.Option(
        "--ranks-per-run",
        metavar="G|auto",
        help="How many ranks compute a run together; auto: as many as pay off for the scene.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]

app = typer.Typer(
    help="When do two adhering vesicles stay together in a flow?",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


class Kind(StrEnum):
    """What a store can be asked for."""

    RUNS = "runs"
    BOUNDARIES = "boundaries"


class ProgressFormat(StrEnum):
    """Whom progress is shown to: people, or a program."""

    TEXT = "text"
    JSON = "json"


ProgressAs = Annotated[
    ProgressFormat,
    typer.Option(
        "--progress", help="How to tell progress on standard error: for people, or in lines of JSON."
    ),
]


def main() -> None:
    """Run the command line; exit status 2 and one message for bad input."""
    pin_threads()
    for command in entry_points(group=COMMANDS):
        app.command(command.name)(command.load())
    with only_first_rank_speaks():
        try:
            app(prog_name="ensemble")
        except BadInput as error:
            print(f"ensemble: {error}", file=sys.stderr)
            sys.exit(2)


@app.command()
def bisect(
    study: Annotated[str, typer.Argument(help="Name of a preset, or a TOML file.")] = DEFAULT_STUDY,
    changes: Changes = [],  # noqa: B006  typer copies it
    store: StorePath = DEFAULT_STORE,
    tolerance: Annotated[float | None, typer.Option(help="Relative width of the brackets.")] = None,
    certify: Annotated[
        bool, typer.Option("--certify", help="Run both ends of every bracket again at finer numerics.")
    ] = False,
    ranks_per_run: RanksPerRun = None,
    progress: ProgressAs = ProgressFormat.TEXT,
    as_json: AsJson = False,
) -> None:
    """Trace a boundary, on all ranks, running only what the store does not have.

    Each rank makes runs of its own unless ranks are asked to share them.  The exit status is 0 only if every
    search converged and every bracket that was to be certified is.
    """
    from ensemble.cli.json_documents import study_document
    from ensemble.cli.result_tables import boundary_table
    from ensemble.mpi.world import abort_guard, on_root, world
    from ensemble.search.critical_value import Status

    communicator = world()
    with abort_guard(communicator):
        size = communicator.Get_size()
        prepared, ranks = on_root(
            communicator, lambda: _prepare(study, changes, tolerance, certify, ranks_per_run, size)
        )
        traced = _trace(communicator, prepared, store, progress, ranks)
    if as_json:
        _print_json(study_document(traced, store))
    else:
        _print_table(boundary_table(traced.boundary))
        print(_cost(traced.cost))
    converged = all(point.status == Status.CONVERGED for point in traced.boundary.points)
    raise typer.Exit(0 if converged else 1)


def _prepare(
    study: str,
    changes: list[str],
    tolerance: float | None,
    certify: bool,
    ranks_per_run: str | None,
    size: int,
) -> tuple[Study, int]:
    """Load the study, then create or sweep the store: a study that is refused leaves no trace."""
    from ensemble.config.documents import load_study
    from ensemble.mpi.groups import chosen_ranks

    with refusing():
        more = [] if tolerance is None else [f"search.tolerance={tolerance!r}"]
        more += ["search.certify=true"] if certify else []
        loaded = load_study(study, [*changes, *more])
        ranks = chosen_ranks(ranks_per_run or "1", loaded.scene, size)
    return loaded, ranks


def _trace(
    communicator: Intracomm, study: Study, path: Path, progress: ProgressFormat, ranks_per_run: int
) -> StudyResult:
    from rich.console import Console

    from ensemble.cli.progress import study_lines, study_progress
    from ensemble.mpi.run_study import run_study
    from ensemble.mpi.store_on_ranks import store_on_ranks

    shown = study_lines if progress is ProgressFormat.JSON else study_progress
    with store_on_ranks(communicator, path) as store, shown(Console(stderr=True)) as show:
        return run_study(communicator, study, store, show, ranks_per_run)


def _cost(cost: RunUsage) -> str:
    runs = f"{cost.runs} runs in {cost.wall_seconds:.1f} s"
    if not cost.busy_fractions:
        return runs
    mean, least = fmean(cost.busy_fractions), min(cost.busy_fractions)
    return f"{runs}; ranks busy {mean:.1%} of the time on average, {least:.1%} at least"


@app.command()
def run(
    scene: Annotated[str, typer.Argument(help="Name of a preset, or a TOML file.")],
    changes: Changes = [],  # noqa: B006
    store: Annotated[Path | None, typer.Option(metavar="DIR", help="Keep the run in this store.")] = None,
    ranks_per_run: RanksPerRun = None,
    progress: ProgressAs = ProgressFormat.TEXT,
    as_json: AsJson = False,
) -> None:
    """Simulate one scene on all ranks together, unless the store has the run.

    The exit status is 1 if it failed numerically.
    """
    from rich.console import Console

    from ensemble.cli.json_documents import run_document
    from ensemble.cli.progress import run_lines, run_progress
    from ensemble.cli.result_tables import run_table
    from ensemble.mpi.single_run import single_run
    from solver.analysis.run import Outcome

    shown = run_lines if progress is ProgressFormat.JSON else run_progress
    summary = single_run(scene, changes, store, ranks_per_run, shown(Console(stderr=True)))
    if summary is None:
        return
    document = run_document(summary)
    if as_json:
        _print_json(document)
    else:
        _print_table(run_table(document))
    raise typer.Exit(1 if summary.outcome is Outcome.FAILED else 0)


@app.command()
def query(
    kind: Annotated[Kind, typer.Argument(help="What to list.")],
    where: Filters = [],  # noqa: B006
    store: StorePath = DEFAULT_STORE,
    as_json: AsJson = False,
) -> None:
    """List the runs or the boundaries of a store."""
    from ensemble.cli.result_tables import boundaries_table, runs_table

    with refusing(), _existing(store) as opened:
        if kind is Kind.RUNS:
            runs = opened.summaries(where)
            documents, table = [summary.document() for summary in runs], runs_table(runs)
        else:
            boundaries = opened.boundaries(where)
            documents = [boundary.model_dump(mode="json") for boundary in boundaries]
            table = boundaries_table(boundaries)
    if as_json:
        _print_json(documents)
    else:
        _print_table(table)


@app.command()
def show(
    name: Annotated[str, typer.Argument(metavar="RUN|BOUNDARY", help="Key of either, or a boundary's name.")],
    output: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Draw it to this file: .png, .svg or .pdf, or a run's movie: .mp4 or .gif."
        ),
    ] = None,
    store: StorePath = DEFAULT_STORE,
) -> None:
    """Print a run or a boundary, or draw it to a file."""
    from ensemble.cli.json_documents import run_document
    from ensemble.cli.result_tables import boundary_table, run_table

    with refusing(), _existing(store) as opened:
        boundary = _boundary(opened, name)
        if output is not None:
            _draw(opened, boundary or name, output)
        elif boundary is not None:
            _print_table(boundary_table(boundary))
        else:
            _print_table(run_table(run_document(opened.summary(name))))


def _boundary(store: Store, name: str) -> Boundary | None:
    """The boundary with this key, or the one with this name that changed last."""
    named = [boundary for boundary in store.boundaries() if name in (boundary.study_key, boundary.name)]
    return named[-1] if named else None


def _draw(store: Store, shown: Boundary | str, output: Path) -> None:
    from ensemble.config.dotted_paths import parameter_value
    from ensemble.figures import phase_diagram, run_figure, save
    from ensemble.figures.figure_files import FIGURE_SUFFIXES, suffix_among
    from ensemble.figures.movie import MOVIE_SUFFIXES, save_movie

    if isinstance(shown, str):
        if suffix_among(output, (*FIGURE_SUFFIXES, *MOVIE_SUFFIXES)) in MOVIE_SUFFIXES:
            save_movie(store.load(shown), output)
        else:
            save(run_figure(store.load(shown)), output)
        return
    if output.suffix.lower() in MOVIE_SUFFIXES:
        raise ValueError(
            f"output: only a run can be a movie, {shown.name} is a boundary, got {output.name!r}"
        )
    runs = []
    for point in shown.points:
        (at,) = point.parameters.values()
        for key in point.runs:
            summary = store.summary(key)
            value = parameter_value(summary.scene, shown.study["search"]["parameter"])
            runs.append((at, value, summary.outcome))
    save(phase_diagram(shown, runs), output)


@app.command()
def report(
    name: Annotated[ReportName, typer.Argument(help="What to report.")],
    quick: Annotated[bool, typer.Option("--quick", help="Minutes instead of hours.")] = False,
    only: Annotated[
        list[str], typer.Option(metavar="SECTION", help="Of the paper, only this section.  Repeatable.")
    ] = [],  # noqa: B006
    ranks_per_run: RanksPerRun = None,
    store: StorePath = DEFAULT_STORE,
    as_json: AsJson = False,
) -> None:
    """Measure the solver (errors, extreme scenes, scaling over all ranks), or recompute the paper.

    The report is written into the store, which keeps its runs too: only what is missing is run.
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
        _print_json(made.document.model_dump(mode="json"))
    else:
        from rich.console import Console
        from rich.markdown import Markdown

        Console().print(Markdown(made.text))
        print(made.directory)


def _paper(only: list[str], quick: bool, store: Path, ranks_per_run: str | None) -> FinishedReport | None:
    """Make the paper's report on all ranks; None on all but the first."""
    from rich.console import Console

    from ensemble.config.documents import load_scene
    from ensemble.mpi.groups import chosen_ranks
    from ensemble.mpi.store_on_ranks import store_on_ranks
    from ensemble.mpi.world import abort_guard, world
    from ensemble.report.paper.make_paper import make_paper
    from ensemble.report.paper.sections import sections_named
    from ensemble.report.report_progress import report_progress

    with refusing():
        sections = sections_named(only)
    communicator = world()
    with abort_guard(communicator):
        # Its scenes have one vesicle or two.
        ranks = chosen_ranks(ranks_per_run or "1", load_scene("doublet-shear"), communicator.Get_size())
        with store_on_ranks(communicator, store) as opened, report_progress(Console(stderr=True)) as tell:
            return make_paper(communicator, opened, sections, quick, tell, ranks)


def _scaling(quick: bool, store: Path) -> FinishedReport | None:
    """Make the report on scaling on all ranks; None on all but the first."""
    from rich.console import Console

    from ensemble.mpi.store_on_ranks import store_on_ranks
    from ensemble.mpi.world import abort_guard, world
    from ensemble.report.report_progress import report_progress
    from ensemble.report.scaling.make_scaling import make_scaling

    communicator = world()
    with abort_guard(communicator):
        with store_on_ranks(communicator, store) as opened, report_progress(Console(stderr=True)) as tell:
            return make_scaling(communicator, opened, quick, tell)


def _measurements(name: ReportName, quick: bool, store: Path) -> FinishedReport | None:
    """Measure the solver on the first rank alone: nothing else may disturb the time that runs take."""
    if launched_rank() != 0:
        return None
    from rich.console import Console

    from ensemble.report.report_progress import report_progress
    from ensemble.report.stability.make_stability import make_stability
    from ensemble.report.work_precision.make_work_precision import make_work_precision

    with ExitStack() as stack:
        with refusing():
            opened = stack.enter_context(_opened(store))
        make = make_stability if name is ReportName.STABILITY else make_work_precision
        return make(opened, quick, stack.enter_context(report_progress(Console(stderr=True))))


@app.command()
def check(store: StorePath = DEFAULT_STORE, as_json: AsJson = False) -> None:
    """Verify every run and boundary of a store; the exit status is 1 if anything is wrong."""
    with refusing(), _existing(store) as opened:
        problems = opened.check()
    if as_json:
        _print_json({"store": str(store), "problems": problems})
    else:
        print("\n".join(problems) or f"{store} is whole")
    raise typer.Exit(1 if problems else 0)


@app.command()
def export(
    key: Annotated[str, typer.Argument(metavar="RUN", help="Key of the run.")],
    file: Annotated[Path, typer.Argument(metavar="FILE", help="HDF5 file to write.")],
    store: StorePath = DEFAULT_STORE,
) -> None:
    """Write a run to a single HDF5 file."""
    from ensemble.store.hdf5_export import export_run

    with refusing(), _existing(store) as opened:
        export_run(opened.summary(key), opened.load(key), file)


def _existing(path: Path) -> Store:
    from ensemble.store import Store

    return Store.existing(path)


def _opened(path: Path) -> Store:
    from ensemble.store import Store

    return Store.open(path)


def _print_json(document: Any) -> None:
    # JSON has no word for NaN or infinity.
    print(json.dumps(document, indent=2, allow_nan=False))


def _print_table(table: Table) -> None:
    from rich.console import Console

    Console().print(table)


if __name__ == "__main__":
    main()
