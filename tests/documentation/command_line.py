"""The command line with the commands of all packages, as `ensemble` has them."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Any

import typer
import typer.main

from ensemble.cli.main import GROUP, app


def _with_entry_points() -> typer.Typer:
    everything = typer.Typer()
    everything.registered_commands = list(app.registered_commands)
    everything.registered_callback = app.registered_callback
    for command in entry_points(group=GROUP):
        everything.command(command.name)(command.load())
    return everything


_APP = _with_entry_points()
COMMAND_LINE: Any = typer.main.get_command(_APP)

# The functions behind the commands, whose options are described by their help.
FUNCTIONS: list[Callable[..., Any]] = [
    command.callback for command in _APP.registered_commands if command.callback
]


def option_names(command: Any) -> set[str]:
    """Return all spellings of the options of a command, or of none."""
    parameters = command.params if command else []
    return {"--help"} | {option for parameter in parameters for option in parameter.opts}
