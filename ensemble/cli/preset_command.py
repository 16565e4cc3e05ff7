"""The command that lists the presets and prints one."""

from __future__ import annotations

from typing import Annotated

import typer

from ensemble.cli.options import AsJson, preset_names_for_completion
from ensemble.cli.printing import print_json, print_table
from ensemble.errors import refusing


def presets(  # numpydoc ignore=PR01
    name: Annotated[
        str | None, typer.Argument(help="Which one to print.", autocompletion=preset_names_for_completion)
    ] = None,
    as_json: AsJson = False,
) -> None:
    """List the presets, or print one as the TOML document that it is.

    For example: ensemble presets critical-hamaker > mine.toml; change it; ensemble bisect mine.toml.
    """
    from ensemble.config.documents import preset_document, preset_text

    if name is not None:
        with refusing():
            document = preset_document(name)
        if as_json:
            print_json(document)
        else:
            print(preset_text(name), end="")
        return
    rows = _described_presets()
    if as_json:
        print_json(rows)
        return
    from rich.table import Table

    table = Table("preset", "command", "what it is")
    for row in rows:
        table.add_row(row["name"], row["command"], row["description"])
    print_table(table)


def _described_presets() -> list[dict[str, str]]:
    from ensemble.config.documents import preset_description, preset_document, preset_names
    from ensemble.questions import kind_of

    return [
        {
            "name": name,
            "command": f"ensemble {kind_of(preset_document(name)).command}",
            "description": preset_description(name),
        }
        for name in preset_names()
    ]
