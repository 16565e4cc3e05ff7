"""Shows people, on standard error, where a study or a simulation stands.

On a terminal it is a table or a bar that changes in place, elsewhere (a log file, a batch job) plain lines.
For a program that has started this one, it is a line of JSON now and then.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, Field
from rich.console import Console, Group
from rich.live import Live
from rich.progress import Progress
from rich.table import Table
from rich.text import Text

from ensemble.cli.result_tables import boundary_cells, boundary_columns, bracket_text

if TYPE_CHECKING:
    from ensemble.mpi.dispatcher import JobProgress
    from ensemble.mpi.run_study import Snapshot


class ProgressLine(BaseModel):
    """How far a study or a simulation has come, as a program reads it: one line of JSON."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    fraction: float = Field(ge=0, le=1)
    message: str


@contextmanager
def study_lines(console: Console) -> Iterator[Callable[[Snapshot], None]]:
    """Give a function that prints the latest snapshot of a study as a `ProgressLine`."""

    def show(snapshot: Snapshot) -> None:
        elapsed, left = snapshot.progress.elapsed, snapshot.progress.seconds_left
        fraction = 0.0 if left is None else elapsed / (elapsed + left)
        _print_line(console, fraction, progress_text(snapshot.progress))

    yield show


@contextmanager
def run_lines(console: Console) -> Iterator[Callable[[float, float], None]]:
    """Give a function that prints a `ProgressLine` whenever a simulation has come a percent further."""
    shown = -1

    def show(time: float, end: float) -> None:
        nonlocal shown
        percent = int(100 * time / end)
        if percent != shown:
            shown = percent
            _print_line(console, min(time / end, 1.0), f"time {time:g} of {end:g}")

    yield show


def _print_line(console: Console, fraction: float, message: str) -> None:
    line = ProgressLine(fraction=fraction, message=message)
    console.print(line.model_dump_json(), soft_wrap=True, highlight=False, markup=False)


@contextmanager
def study_progress(console: Console) -> Iterator[Callable[[Snapshot], None]]:
    """Give a function that shows the latest snapshot of a study."""
    if console.is_terminal:
        with Live(console=console) as live:
            yield lambda snapshot: live.update(
                Group(_table(snapshot), Text(progress_text(snapshot.progress)))
            )
    else:
        yield _Lines(console).show


@contextmanager
def run_progress(console: Console) -> Iterator[Callable[[float, float], None]]:
    """Give a function that shows the time that a simulation has reached, and its latest end."""
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        bar = progress.add_task("simulating")
        yield lambda time, end: progress.update(bar, completed=time, total=end)


def _table(snapshot: Snapshot) -> Table:
    points = snapshot.boundary.points
    table = Table(*boundary_columns(points), "running")
    for point in points:
        (at,) = point.parameters.values()
        values = sorted(task.value for task in snapshot.progress.running.values() if task.sweep_value == at)
        table.add_row(*boundary_cells(point), ", ".join(f"{value:.6g}" for value in values))
    return table


def progress_text(progress: JobProgress[Any]) -> str:
    """Say in one line how far the runs of a job have come."""
    known = f" and {progress.known} from the store" if progress.known else ""
    return (
        f"{progress.runs} runs{known}, {len(progress.running)} running, "
        f"{_duration(progress.elapsed)} elapsed, {_time_left(progress)}"
    )


def _time_left(progress: JobProgress[Any]) -> str:
    if progress.seconds_left is None:
        return "time left unknown"
    return f"about {_duration(progress.seconds_left)} left"


def _duration(seconds: float) -> str:
    return str(timedelta(seconds=round(seconds)))


class _Lines:
    """One line for each change of a bracket or a status, with the state of the whole."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._shown: dict[float, str] = {}

    def show(self, snapshot: Snapshot) -> None:
        """Print what has changed since the last snapshot."""
        for point in snapshot.boundary.points:
            ((name, at),) = point.parameters.items()
            line = f"{name} {at:g}: {bracket_text(point)} {point.status}"
            if point.runs and line != self._shown.get(at):
                self._shown[at] = line
                self._console.print(
                    f"{line} ({progress_text(snapshot.progress)})", soft_wrap=True, highlight=False
                )
