"""Shows on standard error how many of a number of things are done: runs verified, pictures drawn."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import Progress

from ensemble.display.progress_line import ProgressLine

VERIFIED = "runs verified"
SECONDS = 0.5  # between two lines for a program
SECONDS_IN_A_LOG = 10.0


@contextmanager
def counted_progress(console: Console, doing: str, done: str) -> Iterator[Callable[[int, int], None]]:
    """Give a function that shows a bar on a terminal, and plain lines elsewhere.

    Parameters
    ----------
    console : Console
        Where it is shown.
    doing : str
        What the bar is called, such as ``verifying runs``.
    done : str
        What is counted, such as ``runs verified``.

    Yields
    ------
    callable
        Takes the number of those that are done and the number of all.
    """

    def print_line(count: int, total: int) -> None:
        console.print(f"{count} of {total} {done}", soft_wrap=True, highlight=False)

    if console.is_terminal:
        with Progress(console=console, transient=True) as progress:
            bar = progress.add_task(doing, visible=False)  # until there is something to count
            yield lambda count, total: progress.update(bar, completed=count, total=total, visible=True)
    else:
        yield _now_and_then(print_line, SECONDS_IN_A_LOG)


@contextmanager
def check_lines(console: Console) -> Iterator[Callable[[int, int], None]]:
    """Give a function that prints a `ProgressLine` now and then.

    Parameters
    ----------
    console : Console
        Where it is printed.

    Yields
    ------
    callable
        Takes the number of runs that are verified and the number of all.
    """

    def show(verified: int, total: int) -> None:
        fraction = min(verified / max(total, 1), 1.0)
        message = f"{verified} of {total} {VERIFIED}"
        ProgressLine(fraction=fraction, message=message, reached=verified).print_on(console)

    yield _now_and_then(show, SECONDS)


def _now_and_then(show: Callable[[int, int], None], seconds: float) -> Callable[[int, int], None]:
    shown = time.monotonic()

    def show_sometimes(verified: int, total: int) -> None:
        nonlocal shown
        if time.monotonic() - shown > seconds:
            shown = time.monotonic()
            show(verified, total)

    return show_sometimes
