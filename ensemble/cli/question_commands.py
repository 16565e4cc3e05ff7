"""Commands that answer questions: one for each kind of question.

A command of a kind is a signature, and one call of `answer_and_print`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from ensemble.cli.options import (
    AsJson,
    Changes,
    Document,
    NoStore,
    ProgressAs,
    ProgressFormat,
    RanksPerRun,
    StorePath,
)
from ensemble.cli.printing import print_answer
from ensemble.config.defaults import DEFAULT_STORE, DEFAULT_STUDY

if TYPE_CHECKING:
    from ensemble.questions import Answer, Question


def bisect(  # numpydoc ignore=PR01
    study: Document = DEFAULT_STUDY,
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

    Each rank makes runs of its own unless ranks are asked to share them.  The exit status is 0 if every
    search converged and every bracket that was to be certified is, else 4.  The first Ctrl-C keeps runs in
    progress and ends with status 75; the same command goes on.
    """
    if tolerance is not None:
        changes = [*changes, f"search.tolerance={tolerance!r}"]
    if certify:
        changes = [*changes, "search.certify=true"]
    answer_and_print("study", study, changes, store, ranks_per_run, progress, as_json)


def run(  # numpydoc ignore=PR01
    scene: Document,
    changes: Changes = [],  # noqa: B006
    store: StorePath = DEFAULT_STORE,
    no_store: NoStore = False,
    again: Annotated[
        bool, typer.Option("--again", help="Make the run although the store has it; that one is set aside.")
    ] = False,
    ranks_per_run: RanksPerRun = None,
    progress: ProgressAs = ProgressFormat.TEXT,
    as_json: AsJson = False,
) -> None:
    """Simulate one scene on all ranks together, unless the store has the run.

    The exit status is 4 if it failed numerically.  The first Ctrl-C keeps the run as far as it has come and
    ends with status 75; the same command goes on.
    """
    if again and not no_store:
        _set_aside(scene, changes, store)
    place = None if no_store else store
    answer_and_print("scene", scene, changes, place, ranks_per_run, progress, as_json)


def measure_adhesion(  # numpydoc ignore=PR01
    measurement: Document = "adhesion-measurement",
    changes: Changes = [],  # noqa: B006
    store: StorePath = DEFAULT_STORE,
    no_store: NoStore = False,
    progress: ProgressAs = ProgressFormat.TEXT,
    as_json: AsJson = False,
) -> None:
    """Find how strong an adhesion is, from the extension rate at which a fluid trap ends side by side.

    The document has the pair in a trap, with scene.flow.rate the critical rate that was measured as the rate
    rose slowly, and the relative standard errors of the inputs.  The error of the answer is that of the
    inputs, propagated, and of the numerics.  The exit status is 4 if there is no answer.
    """
    place = None if no_store else store
    answer_and_print("measurement", measurement, changes, place, None, progress, as_json)


COMMANDS = (bisect, run, measure_adhesion)


def draw_map(  # numpydoc ignore=PR01
    document: Document,
    changes: Changes = [],  # noqa: B006
    store: StorePath = DEFAULT_STORE,
    ranks_per_run: RanksPerRun = None,
    progress: ProgressAs = ProgressFormat.TEXT,
    as_json: AsJson = False,
) -> None:
    """Find what becomes of a scene all over two of its parameters, on all ranks.

    Cells are run where the label of runs changes, only those that the store does not have; the others have
    the label of those around them.  The exit status is 4 if a run failed numerically.  The first Ctrl-C keeps
    runs in progress and ends with status 75; the same command goes on.
    """
    answer_and_print("map", document, changes, store, ranks_per_run, progress, as_json)


def _set_aside(scene: str, changes: list[str], path: Path) -> None:
    """Take the run of a scene out of a store that has it.  Collective."""
    from ensemble.config.overrides import parse_override
    from ensemble.errors import refusing
    from ensemble.mpi.world import abort_guard, launched_size, on_root, world
    from ensemble.questions import kind_named
    from ensemble.store import Store

    def set_aside() -> None:
        with refusing():
            question = kind_named("scene").load(scene, dict(map(parse_override, changes)))
            with Store.open(path) as store:
                if store.contains(question.key):
                    store.set_aside(question.key)

    communicator = world() if launched_size() > 1 else None
    with abort_guard(communicator):
        on_root(communicator, set_aside)


def answer_and_print(
    kind: str,
    name_or_path: str,
    changes: list[str],
    store: Path | None,
    ranks_per_run: str | None,
    progress: ProgressFormat,
    as_json: bool,
) -> NoReturn:
    """Answer a question on all ranks, print the answer and exit; with status 4 if it is not complete.

    Collective.

    Parameters
    ----------
    kind : str
        Of the question.
    name_or_path : str
        Name of a preset, else a TOML file.
    changes : list of str
        ``path=value``, made before the document is checked.
    store : Path or None
        Directory of the store that keeps the runs, which is created if there is none.
    ranks_per_run : str or None
        A number or ``auto``; None: one if the question has many runs, all if it has one.
    progress : ProgressFormat
        For whom progress is shown.
    as_json : bool
        Whether the answer is printed as one JSON document.

    Raises
    ------
    BadInput
        On every rank, before any work starts.
    typer.Exit
        When the answer has been printed.
    """
    from ensemble.questions import kind_named

    for_program = progress is ProgressFormat.JSON
    answer = _answer(kind_named(kind), name_or_path, changes, store, ranks_per_run, for_program)
    if answer is None:
        raise typer.Exit(0)
    print_answer(answer, as_json)


def _answer(
    kind: type[Question[Any]],
    name_or_path: str,
    changes: list[str],
    store: Path | None,
    ranks_per_run: str | None,
    for_program: bool,
) -> Answer | None:
    """Prepare on the first rank, so that what is refused leaves no trace; then answer on all of them."""
    from rich.console import Console

    from ensemble.config.overrides import parse_override
    from ensemble.display.compilation_lines import compilation_shown
    from ensemble.errors import refusing
    from ensemble.mpi.groups import chosen_ranks
    from ensemble.mpi.world import abort_guard, launched_size, on_root, world

    communicator = world() if kind.has_many_runs or launched_size() > 1 else None
    size = 1 if communicator is None else communicator.Get_size()

    def prepare() -> tuple[Question[Any], int]:
        with refusing():
            question = _loaded(kind, name_or_path, dict(map(parse_override, changes)))
            requested = ranks_per_run or ("1" if kind.has_many_runs else str(size))
            ranks = chosen_ranks(requested, question.scene, size)
        return question, ranks

    with abort_guard(communicator):
        question, ranks = on_root(communicator, prepare)
        console = Console(stderr=True)
        with compilation_shown(console, for_program), kind.progress(console, for_program) as on_change:
            return question.answer(communicator, store, ranks, on_change)


def _loaded(kind: type[Question[Any]], name_or_path: str, changes: dict[str, Any]) -> Question[Any]:
    """Load a question; if its document is of another kind, name the command for that."""
    from ensemble.config.documents import read_document
    from ensemble.questions import kinds

    try:
        return kind.load(name_or_path, changes)
    except ValueError:
        document = read_document(name_or_path)
        for other in kinds():
            if other.marker in document and kind.marker not in document:
                raise ValueError(
                    f"{name_or_path}: this is a {other.kind}: use ensemble {other.command}"
                ) from None
        raise
