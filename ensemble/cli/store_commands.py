"""Commands that read a store."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ensemble.cli.options import AsJson, Filters, StorePath
from ensemble.cli.printing import print_json, print_table
from ensemble.config.defaults import DEFAULT_STORE
from ensemble.errors import refusing

if TYPE_CHECKING:
    from ensemble.questions import StoredAnswer, StoredAnswers
    from ensemble.store import Store


def _collections() -> list[str]:
    from ensemble.questions import kinds

    return [kind.collection for kind in kinds() if kind.collection is not None]


def query(  # numpydoc ignore=PR01
    collection: Annotated[
        str,
        typer.Argument(
            metavar="runs|boundaries|…", help="What to list.", autocompletion=_collections, show_default=False
        ),
    ],
    where: Filters = [],  # noqa: B006  typer copies it
    store: StorePath = DEFAULT_STORE,
    as_json: AsJson = False,
) -> None:
    """List the runs or the boundaries of a store."""
    with refusing(), _existing(store) as opened:
        answers = _all_stored(opened, collection, where)
    if as_json:
        print_json(answers.json_documents)
    else:
        print_table(answers.table)


def _all_stored(store: Store, collection: str, where: list[str]) -> StoredAnswers:
    from ensemble.questions import kinds

    for kind in kinds():
        if kind.collection == collection:
            return kind.all_stored(store, where)
    raise ValueError(f"{collection!r} — must be one of {', '.join(_collections())}")


def show(  # numpydoc ignore=PR01
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
    with refusing(), _existing(store) as opened:
        answer = _stored(opened, name)
        if output is not None:
            answer.draw(output)
        else:
            print_table(answer.table())


def _stored(store: Store, name: str) -> StoredAnswer:
    from ensemble.questions import kinds

    for kind in kinds():
        answer = kind.stored(store, name)
        if answer is not None:
            return answer
    raise ValueError(f"{name!r} — names none of the {' and '.join(_collections())} in {store.path}")


def check(  # numpydoc ignore=PR01
    store: StorePath = DEFAULT_STORE,
    as_json: AsJson = False,
) -> None:
    """Verify every run and boundary of a store; the exit status is 1 if anything is wrong."""
    with refusing(), _existing(store) as opened:
        problems = opened.check()
    if as_json:
        print_json({"store": str(store), "problems": problems})
    else:
        print("\n".join(problems) or f"{store} is whole")
    raise typer.Exit(1 if problems else 0)


def export(  # numpydoc ignore=PR01
    key: Annotated[str, typer.Argument(metavar="RUN", help="Key of the run.")],
    file: Annotated[Path, typer.Argument(metavar="FILE", help="HDF5 file to write.")],
    store: StorePath = DEFAULT_STORE,
) -> None:
    """Write a run to a single HDF5 file."""
    from ensemble.store.hdf5_export import export_run

    with refusing(), _existing(store) as opened:
        export_run(opened.summary(key), opened.load(key), file)


COMMANDS = (query, show, check, export)


def _existing(path: Path) -> Store:
    from ensemble.store import Store

    return Store.existing(path)
