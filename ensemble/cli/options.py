"""Options that several commands share."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class ProgressFormat(StrEnum):
    """Whom progress is shown to: people, or a program."""

    TEXT = "text"
    JSON = "json"


def preset_names_for_completion() -> list[str]:
    """Return the names of the presets, for the completion of shells."""
    from ensemble.config.documents import preset_names

    return list(preset_names())


Document = Annotated[
    str, typer.Argument(help="Name of a preset, or a TOML file.", autocompletion=preset_names_for_completion)
]
Changes = Annotated[
    list[str],
    typer.Option(
        "--set", metavar="PATH=VALUE", help="Change a field: dotted path and TOML value.  Repeatable."
    ),
]
UnitsOf = Annotated[
    str | None,
    typer.Option(
        "--units",
        metavar="DOCUMENT",
        help="Use the units of this TOML file instead of those that the record has.",
        show_default=False,
    ),
]
StorePath = Annotated[Path, typer.Option("--store", metavar="DIR", help="Directory of the store.")]
NoStore = Annotated[bool, typer.Option("--no-store", help="Keep nothing.")]
Filters = Annotated[
    list[str],
    typer.Option(metavar="CONDITION", help="For example flow.rate>=0.5 or outcome=bound.  Repeatable."),
]
Sort = Annotated[
    str | None,
    typer.Option(
        metavar="PATH",
        help="Field to sort by; -PATH for the largest first.  Left out, the newest come first.",
        show_default=False,
    ),
]
Limit = Annotated[int, typer.Option(min=0, metavar="N", help="List at most so many; 0 lists all.")]
Columns = Annotated[
    list[str],
    typer.Option(
        "--columns",
        metavar="PATH,…",
        help="Fields to show, named as for --where.  Repeatable.",
    ),
]
RanksPerRun = Annotated[
    str | None,
    typer.Option(
        "--ranks-per-run",
        metavar="G|auto",
        help="How many ranks compute a run together; auto: as many as pay off for the scene.",
    ),
]
ProgressAs = Annotated[
    ProgressFormat,
    typer.Option("--progress", help="How standard error shows progress: for people, or in lines of JSON."),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]
