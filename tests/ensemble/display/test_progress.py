"""What is told while a live display stands on the terminal."""

from __future__ import annotations

from io import StringIO

import pytest
from rich.console import Console
from rich.text import Text

from ensemble.display.progress import job_progress, run_progress
from ensemble.mpi.dispatcher import JobProgress
from ensemble.mpi.world import tell


def progress(runs: int) -> JobProgress:
    return JobProgress(running={}, runs=runs, known=0, elapsed=1.0, seconds_left=None)


def test_what_is_told_stands_above_a_live_display(capsys) -> None:
    output = StringIO()
    with job_progress(Console(file=output, force_terminal=True, width=80)) as show:
        show(progress(1))
        tell("ends after the next step of its runs")
        show(progress(2))
    lines = Text.from_ansi(output.getvalue()).plain
    assert lines.count("ensemble: ends after the next step of its runs\n") == 1
    assert lines.index("ensemble: ends") < lines.index("2 runs")
    tell("afterwards")
    assert capsys.readouterr().err == "", "outside of a display the process's own stream is used"


def test_a_run_in_a_log_has_a_line_now_and_then(monkeypatch: pytest.MonkeyPatch) -> None:
    output = StringIO()
    with run_progress(Console(file=output, width=80)) as show:
        show(1.0, 2.0)
        assert output.getvalue() == "", "a short run has none"
        monkeypatch.setattr("ensemble.display.progress._BETWEEN_LINES", 0.0)
        show(1.5, 2.0)
    assert output.getvalue() == "time 1.5 of 2\n"
