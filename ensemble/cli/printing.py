"""What commands print on standard output."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from textwrap import indent
from typing import TYPE_CHECKING, Any, NoReturn

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from ensemble.questions import Answer
    from ensemble.store.columns import ListColumn


def print_json(document: Any) -> None:
    """Print a JSON document.

    Parameters
    ----------
    document : object
        JSON data; JSON has no word for NaN or infinity.
    """
    print(json.dumps(document, indent=2, allow_nan=False))


def print_json_array(documents: Iterable[Any]) -> None:
    """Print a JSON array, one element after the other.

    Parameters
    ----------
    documents : iterable of object
        JSON data.
    """
    opening = "["
    for document in documents:
        print(f"{opening}\n{indent(json.dumps(document, indent=2, allow_nan=False), '  ')}", end="")
        opening = ","
    print("[]" if opening == "[" else "\n]")


def print_list(columns: Sequence[ListColumn], documents: Iterable[Mapping[str, Any]]) -> None:
    """Print a list as a table or, when not on a terminal, as tab-separated values, one line after the other.

    Parameters
    ----------
    columns : sequence of ListColumn
        What is shown.
    documents : iterable of mapping
        The records, which are read as they are printed.
    """
    from rich.console import Console

    from ensemble.display.result_tables import list_cell, list_table

    console = Console()
    if console.is_terminal:
        console.print(list_table(columns, documents))
        return
    print("\t".join(column.heading for column in columns))
    for document in documents:
        print("\t".join(list_cell(column.value(document)) for column in columns))


def print_table(table: Table) -> None:
    """Print a table as wide as the terminal, or elsewhere as tab-separated values, whole ones.

    A launcher hides whether there is a terminal: its users get the table.

    Parameters
    ----------
    table : Table
        Of rich.
    """
    from rich.console import Console

    from ensemble.display.result_tables import for_people, plain
    from ensemble.mpi.world import is_launched

    console = Console()
    if console.is_terminal or is_launched():
        console.print(for_people(table))
        return
    columns = table.columns
    if table.show_header:
        print("\t".join(plain(column.header) for column in columns))
    for row in zip(*(column.cells for column in columns), strict=True):
        print("\t".join(map(plain, row)))


def print_answer(answer: Answer, as_json: bool) -> NoReturn:
    """Print an answer and exit with its status.

    Parameters
    ----------
    answer : Answer
    as_json : bool
        Whether it is printed as one JSON document.

    Raises
    ------
    typer.Exit
        When it has been printed.
    """
    if as_json:
        print_json(answer.json_document())
    else:
        print_table(answer.table())
        if answer.footer is not None:
            print(answer.footer)
    raise typer.Exit(answer.status)
