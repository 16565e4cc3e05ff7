"""Shows on standard error how far the verification of a store has come."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import Progress

from ensemble.display.progress_line import ProgressLine

SECONDS = 0.5  # between two lines for a program
SECONDS_IN_A_LOG = 10.0


@contextmanager
def check_progress(console: Console) -> Iterator[Callable[[int, int], None]]:
    """Give a function that shows a bar on a terminal, and plain lines elsewhere.

    Parameters
    ----------
    console : Console
        Where it is shown.

    Yields
    ------
    callable
        Takes the number of runs that are verified and the number of all.
    """
    if console.is_terminal:
        with Progress(console=console, transient=True) as progress:
            bar = progress.add_task("verifying runs")
            yield lambda verified, total: progress.update(bar, completed=verified, total=total)
    else:
        yield _now_and_then(
            lambda verified, total: console.print(_text(verified, total), soft_wrap=True, highlight=False),
            SECONDS_IN_A_LOG,
        )


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
        message = _text(verified, total)
        ProgressLine(fraction=fraction, message=message, reached=verified).print_on(console)

    yield _now_and_then(show, SECONDS)


def _text(verified: int, total: int) -> str:
    return f"{verified} of {total} runs verified"


def _now_and_then(show: Callable[[int, int], None], seconds: float) -> Callable[[int, int], None]:
    shown = time.monotonic()

    def show_sometimes(verified: int, total: int) -> None:
        nonlocal shown
        if time.monotonic() - shown > seconds:
            shown = time.monotonic()
            show(verified, total)

    return show_sometimes
