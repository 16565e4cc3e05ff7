"""Progress of a report on standard error: which run is being made."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

Tell = Callable[[str], None]


@contextmanager
def report_progress(console: Console) -> Iterator[Tell]:
    """Give a function that shows a line about every run: a live line on a terminal, plain lines elsewhere.

    Parameters
    ----------
    console : Console

    Yields
    ------
    callable
        Takes a line of text.
    """
    if not console.is_terminal:
        yield lambda line: console.print(line, soft_wrap=True, highlight=False, markup=False)
        return
    columns = (
        BarColumn(pulse_style="cyan"),
        TextColumn("{task.description}", markup=False),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("", total=None)
        yield lambda line: progress.update(task, description=line)
