"""The command line.

Every command imports what it needs when it is called: no command waits for libraries that it does not use.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import entry_points
from io import TextIOWrapper
from typing import Annotated

import typer

from ensemble.cli import (
    preset_command,
    question_commands,
    report_commands,
    schema_command,
    start_command,
    steady_commands,
    store_commands,
    units_command,
)
from ensemble.errors import BadInput, told_in_a_line
from ensemble.mpi.world import only_first_rank_speaks, pin_threads

GROUP = "ensemble.commands"  # of entry points: functions that other distributions add as commands

app = typer.Typer(
    help="When do two adhering vesicles stay together in a flow?",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
for _command in (
    *question_commands.COMMANDS,
    steady_commands.steady,
    *store_commands.COMMANDS,
    report_commands.report,
    preset_command.presets,
    start_command.start_from,
    units_command.units,
    schema_command.schema,
):
    app.command()(_command)
# The names are words of Python.
app.command("continue")(steady_commands.follow)
app.command("map")(question_commands.draw_map)


def _print_version(requested: bool) -> None:
    if requested:
        from importlib.metadata import version

        from ensemble.config.run_key import DISTRIBUTION

        print(version(DISTRIBUTION))
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version and exit.", callback=_print_version, is_eager=True),
    ] = False,
) -> None:
    pass


@contextmanager
def _flushed_output() -> Iterator[None]:
    """Raise within the command what the interpreter would print after its end: output that nothing takes."""
    try:
        try:
            yield
        finally:
            sys.stdout.flush()
    except OSError:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        raise


def main() -> None:
    """Run the command line.

    Bad input ends it with status 2, and trouble with the machine or the store with status 1; each with one
    line; without one if nobody reads the output any more.
    """
    pin_threads()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # what a terminal cannot show costs no answer
    for command in entry_points(group=GROUP):
        app.command(command.name)(command.load())
    with only_first_rank_speaks():
        try:
            with _flushed_output():
                app(prog_name="ensemble")
        except BadInput as error:
            print(f"ensemble: {error}", file=sys.stderr)
            sys.exit(2)
        except BrokenPipeError:  # whoever read the output has seen enough, such as head
            sys.exit(1)
        except Exception as error:
            line = told_in_a_line(error)
            if line is None:
                raise
            print(f"ensemble: {line}", file=sys.stderr)
            sys.exit(1)


if __name__ == "__main__":
    main()
