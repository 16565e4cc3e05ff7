"""Says that functions are being compiled, which the first runs on a machine wait for."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ensemble.display.progress_line import ProgressLine

if TYPE_CHECKING:
    from rich.console import Console

REPEAT_SECONDS = 10.0
_LOGGER = "solver.compilation"  # its records of level INFO name the functions


@contextmanager
def compilation_shown(console: Console, for_program: bool = False) -> Iterator[None]:
    """Print a line when compilation begins within the block, and again while it goes on.

    Parameters
    ----------
    console : Console
        Where it is printed.
    for_program : bool
        Whether it is read by a program: then as a `ProgressLine`.

    Yields
    ------
    None
    """
    logger = logging.getLogger(_LOGGER)
    handler, level = _Lines(console, for_program), logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.setLevel(level)
        logger.removeHandler(handler)


class _Lines(logging.Handler):
    def __init__(self, console: Console, for_program: bool) -> None:
        super().__init__()
        self._console = console
        self._for_program = for_program
        self._what = "compiling what this scene needs, once on this machine"
        self._functions = 0
        self._begin = self._next = time.monotonic()

    def emit(self, record: logging.LogRecord) -> None:
        """Count a function, and print if it is the first one or some time has passed.

        A warning says that what is compiled is not kept.
        """
        if record.levelno > logging.INFO:
            self._what = "compiling what this scene needs"
            self._print(record.getMessage())
            return
        now = time.monotonic()
        if self._functions == 0:
            self._begin = self._next = now
        self._functions += 1
        if now < self._next:
            return
        self._next = now + REPEAT_SECONDS
        text = self._what
        if self._functions > 1:
            text += f": {self._functions} functions in {now - self._begin:.0f} s so far"
        self._print(text)

    def _print(self, text: str) -> None:
        if self._for_program:
            ProgressLine(fraction=0.0, message=text, reached=0.0).print_on(self._console)
        else:
            self._console.print(text, soft_wrap=True, highlight=False, markup=False)
