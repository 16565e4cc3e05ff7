"""The command that prints the JSON Schema of documents."""

from __future__ import annotations

from typing import Annotated

import typer

from ensemble.cli.printing import print_json
from ensemble.errors import refusing


def _kind_names() -> list[str]:
    from ensemble.questions import kinds

    return [kind.kind for kind in kinds()]


def schema(  # numpydoc ignore=PR01
    kind: Annotated[
        str, typer.Argument(metavar="study|scene|…", help="Of which documents.", autocompletion=_kind_names)
    ],
) -> None:
    """Print the JSON Schema of a kind of TOML documents, by which editors complete and check them.

    For example: ensemble schema scene > scene.schema.json, and #:schema scene.schema.json as the first line
    of the document.
    """
    from ensemble.config.document_schema import document_schema
    from ensemble.questions import kind_named

    with refusing():
        model = kind_named(kind).document_type
    print_json(document_schema(model))
