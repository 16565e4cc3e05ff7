"""What commands print on standard output."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table


def print_json(document: Any) -> None:
    """Print a JSON document.

    Parameters
    ----------
    document : object
        JSON data; JSON has no word for NaN or infinity.
    """
    print(json.dumps(document, indent=2, allow_nan=False))


def print_table(table: Table) -> None:
    """Print a table, as wide as the terminal.

    Parameters
    ----------
    table : Table
        Of rich.
    """
    from rich.console import Console

    Console().print(table)
