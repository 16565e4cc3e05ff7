"""What is said while the kernels are compiled."""

from __future__ import annotations

import io
import json
import logging

import pytest
from rich.console import Console

import ensemble.display.compilation_lines as display
from ensemble.display.compilation_lines import compilation_shown

KERNELS = logging.getLogger("solver.compilation")


def lines_about(functions: int, for_program: bool = False) -> list[str]:
    """What is printed while so many functions are compiled."""
    printed = io.StringIO()
    with compilation_shown(Console(file=printed), for_program):
        for _ in range(functions):
            KERNELS.info("compiling %s", "kernel")
    KERNELS.info("compiling %s", "one that nobody asks about")
    return printed.getvalue().splitlines()


def test_compilation_is_said_once_and_then_now_and_again(monkeypatch: pytest.MonkeyPatch) -> None:
    assert lines_about(0) == []
    assert lines_about(3) == ["compiling what this scene needs, once on this machine"]
    monkeypatch.setattr(display, "REPEAT_SECONDS", 0.0)
    assert lines_about(3)[1:] == [
        "compiling what this scene needs, once on this machine: 2 functions in 0 s so far",
        "compiling what this scene needs, once on this machine: 3 functions in 0 s so far",
    ]


def test_it_is_said_that_nothing_is_kept() -> None:
    printed = io.StringIO()
    with compilation_shown(Console(file=printed)):
        KERNELS.warning("compiled functions are not kept (%s)", "no directory can be written to")
        KERNELS.info("compiling %s", "kernel")
    assert printed.getvalue().splitlines() == [
        "compiled functions are not kept (no directory can be written to)",
        "compiling what this scene needs",
    ]


def test_a_program_reads_of_compilation_in_json() -> None:
    (line,) = lines_about(1, for_program=True)
    assert json.loads(line) == {
        "fraction": 0.0,
        "message": "compiling what this scene needs, once on this machine",
        "reached": 0.0,
    }
