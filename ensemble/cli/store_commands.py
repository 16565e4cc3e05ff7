"""Commands that read, repair and merge stores."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ensemble.cli.options import (
    AsJson,
    Columns,
    Filters,
    Limit,
    ProgressAs,
    ProgressFormat,
    Sort,
    StorePath,
    UnitsOf,
)
from ensemble.cli.printing import print_json, print_json_array, print_list, print_table
from ensemble.config.defaults import DEFAULT_STORE, LISTED
from ensemble.config.figure_options import USUAL, FigureOptions, parse_size
from ensemble.errors import refusing

if TYPE_CHECKING:
    from ensemble.questions import Question, StoredAnswer, StoredAnswers
    from ensemble.questions.branches import StoredBranches
    from ensemble.store import Store
    from ensemble.store.listing import Listing
    from ensemble.store.verification import OnProgress
    from solver.scene import Units


def _collections() -> list[str]:
    return [shelf.collection for shelf in _shelves() if shelf.collection is not None]


def _shelves() -> list[type[Question[Any]] | type[StoredBranches]]:
    """Return what knows the answers of a store: the kinds of question, and the branches."""
    from ensemble.questions import kinds
    from ensemble.questions.branches import StoredBranches

    return [*kinds(), StoredBranches]


def query(  # numpydoc ignore=PR01
    collection: Annotated[
        str,
        typer.Argument(
            metavar="runs|boundaries|maps|branches|…",
            help="What to list.",
            autocompletion=_collections,
            show_default=False,
        ),
    ],
    where: Filters = [],  # noqa: B006  typer copies it
    sort: Sort = None,
    limit: Limit = LISTED,
    columns: Columns = [],  # noqa: B006
    reports: Annotated[bool, typer.Option("--reports", help="List runs made for reports, too.")] = False,
    store: StorePath = DEFAULT_STORE,
    as_json: AsJson = False,
) -> None:
    """List the runs, the boundaries, the maps or the branches of steady states of a store."""
    from ensemble.questions.scene_question import SceneQuestion
    from ensemble.store.filters import without_reports
    from ensemble.store.listing import Listing

    is_chosen = collection == SceneQuestion.collection and not reports
    paths = [path.strip() for column in columns for path in column.split(",")]
    with refusing(), _existing(store) as opened:
        filters = without_reports(where) if is_chosen else tuple(where)
        # One more, to know whether there are more.
        listing = Listing(filters, sort, limit + 1 if limit else None)
        answers = _all_stored(opened, collection, listing, paths)
        documents = islice(answers.json_documents, limit or None)
        if as_json:
            print_json_array(documents)
        else:
            print_list(answers.columns, documents)
        if next(answers.json_documents, None) is not None:
            print(f"ensemble: there are more than {limit}; --limit 0 lists all", file=sys.stderr)
        left_out = Listing((*where, "report!=null"), limit=1)
        if filters != tuple(where) and next(opened.run_records(left_out), None) is not None:
            print(
                "ensemble: runs made for reports are left out; --reports lists them",
                file=sys.stderr,
            )


def _all_stored(store: Store, collection: str, listing: Listing, columns: list[str]) -> StoredAnswers:
    for shelf in _shelves():
        if shelf.collection == collection:
            return shelf.all_stored(store, listing, columns)
    raise ValueError(f"{collection!r} — must be one of {', '.join(_collections())}")


def show(  # numpydoc ignore=PR01
    name: Annotated[
        str,
        typer.Argument(
            metavar="RUN|BOUNDARY|MAP|BRANCH",
            help="Key of one of these or its beginning, or a name; also the key of a run that goes on.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Draw it to this file: .png, .svg or .pdf, or a run's movie: .mp4 or .gif."
        ),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(metavar="WxH", help="Width and height of a figure in centimeters, such as 8.6x20."),
    ] = None,
    dpi: Annotated[
        int | None,
        typer.Option(help="Points of a .png on an inch, from 30 to 1200.", show_default=str(USUAL.dpi)),
    ] = None,
    svg_text: Annotated[
        bool, typer.Option("--svg-text", help="Keep letters in an .svg as text instead of curves.")
    ] = False,
    units: UnitsOf = None,
    store: StorePath = DEFAULT_STORE,
    as_json: AsJson = False,
) -> None:
    """Print a run, a boundary, a map or a branch of steady states, or draw it to a file."""
    from rich.console import Console

    from ensemble.display.counted_progress import counted_progress

    drawing = {"size": size, "dpi": dpi, "svg_text": svg_text or None}
    with refusing():
        options = _figure_options({name: each for name, each in drawing.items() if each is not None}, output)
        if output is not None and as_json:
            raise ValueError("--json — nothing is printed with --output")
    with refusing(), _existing(store) as opened:
        answer = _stored(opened, name)
        if units is not None:
            answer = answer.in_units(_units_of(units))
        if output is not None:
            with counted_progress(Console(stderr=True), "drawing pictures", "pictures drawn") as on_progress:
                answer.draw(output, options, on_progress)
        elif as_json:
            print_json(answer.json_document())
        else:
            print_table(answer.table())


def _figure_options(given: dict[str, Any], output: Path | None) -> FigureOptions:
    from ensemble.config.validation import validated

    if given and output is None:
        names = " and ".join("--" + name.replace("_", "-") for name in given)
        raise ValueError(f"{names} — needs --output, the file of a figure")
    if "size" in given:
        given = given | {"size": parse_size(given["size"])}
    return validated(FigureOptions, given)


def _stored(store: Store, name: str) -> StoredAnswer:
    for shelf in _shelves():
        answer = shelf.stored(store, name)
        if answer is not None:
            return answer
    raise ValueError(f"{name!r} — names none of the {' and '.join(_collections())} in {store.path}")


def check(  # numpydoc ignore=PR01
    store: StorePath = DEFAULT_STORE,
    repair: Annotated[
        bool,
        typer.Option(
            "--repair",
            help="Rebuild a lost catalog; set damaged runs and other answers aside in lost+found.",
        ),
    ] = False,
    processes: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="How many verify at once; left out, one for each processor."),
    ] = None,
    progress: ProgressAs = ProgressFormat.TEXT,
    as_json: AsJson = False,
) -> None:
    """Verify every run, boundary, map and branch of a store; the exit status is 1 if anything is wrong.

    Runs that were interrupted and have a checkpoint are named, and are no problem.  A check that was
    interrupted goes on where it was, within a day.
    """
    from rich.console import Console

    from ensemble.display.counted_progress import VERIFIED, check_lines, counted_progress
    from ensemble.store.unfinished import interrupted_runs

    at_once = processes or len(os.sched_getaffinity(0))
    console = Console(stderr=True)
    display = (
        check_lines(console)
        if progress is ProgressFormat.JSON
        else counted_progress(console, "verifying runs", VERIFIED)
    )
    with refusing(), display as on_progress:
        done = _repaired(store, on_progress, at_once) if repair else []
        with _existing(store) as opened:
            problems = opened.check(on_progress, at_once)
            interrupted = list(interrupted_runs(opened.path))
    if as_json:
        print_json({"store": str(store), "done": done, "problems": problems, "interrupted": interrupted})
    else:
        print("\n".join([*([*done, *problems] or [f"{store} is whole"]), *interrupted]))
    raise typer.Exit(1 if problems else 0)


def _repaired(store: Path, on_progress: OnProgress, processes: int) -> list[str]:
    from ensemble.store.repair import repair

    return repair(store, on_progress, processes)


def merge(  # numpydoc ignore=PR01
    source: Annotated[Path, typer.Argument(metavar="STORE", help="Store that is copied.")],
    into: Annotated[Path, typer.Option(metavar="DIR", help="Store that takes them.")],
    as_json: AsJson = False,
) -> None:
    """Copy all that one store has into another; of a boundary or map in both, the newer one stays."""
    from ensemble.store import Store
    from ensemble.store.merge import merge as copy

    with refusing(), _existing(source) as opened, Store.open(into) as target:
        merged = copy(opened, target)
    if as_json:
        print_json(merged._asdict())
    else:
        copied = f"copied {merged.runs} runs, {merged.boundaries} boundaries, {merged.branches} branches"
        print(f"{copied} and {merged.maps} maps; {merged.known_runs} runs were there already")


def export(  # numpydoc ignore=PR01
    key: Annotated[str, typer.Argument(metavar="RUN", help="Key of the run or its beginning.")],
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="File to write: .h5, .hdf5 or .nc (HDF5 after netCDF-4), or .vtkhdf for ParaView.",
        ),
    ],
    forces: Annotated[
        bool, typer.Option("--forces", help="With the forces of bending, tension and adhesion at the points.")
    ] = False,
    units: UnitsOf = None,
    store: StorePath = DEFAULT_STORE,
) -> None:
    """Write a run to a single file for other programs."""
    from ensemble.store.exports import exported_arrays, writer_for

    with refusing():
        write = writer_for(file)
    with refusing(), _existing(store) as opened:
        key = opened.full_key(key)
        summary = opened.summary(key)
        if units is not None:
            summary = summary.in_units(_units_of(units))
        write(summary, exported_arrays(replace(opened.load(key), scene=summary.scene), forces), file)


def _units_of(document: str) -> Units:
    from ensemble.config.documents import load_units

    return load_units(document)


COMMANDS = (query, show, check, merge, export)


def _existing(path: Path) -> Store:
    from ensemble.store import Store

    return Store.existing(path)
