"""Shows on standard error how far a job, a simulation or a report has come.

On a terminal it is a table or a bar that changes in place, elsewhere (a log file, a batch job) plain lines.
For a program that has started this one, it is a line of JSON now and then.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from datetime import timedelta
from itertools import count
from time import monotonic
from typing import TYPE_CHECKING, Any

from rich.console import Console, Group
from rich.live import Live
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from ensemble.display.compilation_lines import compilation_shown
from ensemble.display.progress_line import ProgressLine
from ensemble.display.result_tables import (
    boundary_cells,
    boundary_columns,
    bracket_text,
    for_people,
    place_text,
)
from ensemble.mpi.world import telling

if TYPE_CHECKING:
    from rich.console import RenderableType

    from ensemble.mpi.dispatcher import JobProgress
    from ensemble.mpi.run_study import Snapshot

_BETWEEN_LINES = 10.0  # seconds; a shorter run is not worth a line in a log

# A context manager that gives a function to call whenever something has changed.
Display = AbstractContextManager[Callable[..., None]]


@contextmanager
def job_lines(console: Console) -> Iterator[Callable[[JobProgress[Any]], None]]:
    """Give a function that prints the progress of a job as a `ProgressLine`.

    Parameters
    ----------
    console : Console
        Where it is printed.

    Yields
    ------
    callable
        Takes the progress of the job.
    """
    yield lambda progress: _print_line(console, progress, progress_text(progress))


@contextmanager
def job_progress(console: Console) -> Iterator[Callable[[JobProgress[Any]], None]]:
    """Give a function that shows the progress of a job: a live line on a terminal, plain lines elsewhere.

    Parameters
    ----------
    console : Console
        Where it is shown.

    Yields
    ------
    callable
        Takes the progress of the job.
    """
    if console.is_terminal:
        with _live(console) as live:
            yield lambda progress: live.update(Text(progress_text(progress)))
    else:
        yield lambda progress: console.print(progress_text(progress), soft_wrap=True, highlight=False)


@contextmanager
def study_lines(console: Console) -> Iterator[Callable[[Snapshot], None]]:
    """Give a function that prints the progress of a study as a `ProgressLine`, and each change of a bracket.

    Parameters
    ----------
    console : Console
        Where it is printed.

    Yields
    ------
    callable
        Takes the latest snapshot of the study.
    """
    changed = _ChangedPoints()

    def show(snapshot: Snapshot) -> None:
        text = progress_text(snapshot.progress)
        for line in changed.since_the_last(snapshot) or [text]:
            _print_line(console, snapshot.progress, line)

    yield show


@contextmanager
def study_progress(console: Console) -> Iterator[Callable[[Snapshot], None]]:
    """Give a function that shows how far a study has come: all of its points, or those that have changed.

    Parameters
    ----------
    console : Console
        Where it is shown.

    Yields
    ------
    callable
        Takes the latest snapshot of the study.
    """
    if console.is_terminal:
        with _live(console) as live:
            yield lambda snapshot: live.update(
                Group(_table(snapshot), Text(progress_text(snapshot.progress)))
            )
    else:
        changed = _ChangedPoints()

        def show(snapshot: Snapshot) -> None:
            for line in changed.since_the_last(snapshot):
                console.print(line, soft_wrap=True, highlight=False)

        yield show


@contextmanager
def run_lines(console: Console) -> Iterator[Callable[[float, float], None]]:
    """Give a function that prints a `ProgressLine` whenever a simulation has come a percent further.

    Parameters
    ----------
    console : Console
        Where it is printed.

    Yields
    ------
    callable
        Takes the time that the simulation has reached and its latest end.
    """
    shown = -1

    def show(time: float, end: float) -> None:
        nonlocal shown
        percent = int(100 * time / end)
        if percent != shown:
            shown = percent
            message = f"time {time:g} of {end:g}"
            ProgressLine(fraction=min(time / end, 1.0), message=message, reached=percent).print_on(console)

    yield show


@contextmanager
def run_progress(console: Console) -> Iterator[Callable[[float, float], None]]:
    """Give a function that shows a bar for a simulation, or off a terminal a line every ten seconds.

    Parameters
    ----------
    console : Console
        Where it is shown.

    Yields
    ------
    callable
        Takes the time that the simulation has reached and its latest end.
    """
    if not console.is_terminal:
        shown = monotonic()

        def show(time: float, end: float) -> None:
            nonlocal shown
            if monotonic() - shown >= _BETWEEN_LINES:
                shown = monotonic()
                console.print(f"time {time:g} of {end:g}", soft_wrap=True, highlight=False)

        yield show
        return
    with Progress(console=console, transient=True) as progress, told_above(console):
        bar = progress.add_task("simulating")
        yield lambda time, end: progress.update(bar, completed=time, total=end)


@contextmanager
def step_lines(console: Console, steps: int) -> Iterator[Callable[[str], None]]:
    """Give a function that prints a `ProgressLine` at the beginning of each step of an answer.

    Parameters
    ----------
    console : Console
        Where it is printed.
    steps : int
        How many there are.

    Yields
    ------
    callable
        Takes what is done next.
    """
    begun = count()

    def show(step: str) -> None:
        done = next(begun)
        ProgressLine(fraction=min(done / steps, 1.0), message=step, reached=done).print_on(console)

    yield show


def progress_text(progress: JobProgress[Any]) -> str:
    """Say in one line how far the runs of a job have come.

    Parameters
    ----------
    progress : JobProgress
        Of the job.

    Returns
    -------
    str
    """
    known = f" and {progress.known} from the store" if progress.known else ""
    return (
        f"{progress.runs} runs{known}, {len(progress.running)} running, "
        f"{_duration(progress.elapsed)} elapsed, {_time_left(progress)}"
    )


@contextmanager
def told_above(console: Console) -> Iterator[None]:
    """Show what is told within the block above a live display of the console, which would cover it.

    Parameters
    ----------
    console : Console

    Yields
    ------
    None
    """
    with telling(lambda line: console.print(line, highlight=False, markup=False)):
        yield


@contextmanager
def _live(console: Console) -> Iterator[Live]:
    # Transient: what was found is printed afterwards.
    with Live(console=console, transient=True) as live, told_above(console):
        yield live


@contextmanager
def report_progress(console: Console) -> Iterator[Callable[[str], None]]:
    """Give a function that shows a line about every run: a live line on a terminal, plain lines elsewhere.

    Compilation, which the first run waits for, is shown as well.

    Parameters
    ----------
    console : Console

    Yields
    ------
    callable
        Takes a line of text.
    """
    columns = (
        BarColumn(pulse_style="cyan"),
        TextColumn("{task.description}", markup=False),
        TimeElapsedColumn(),
    )
    with compilation_shown(console):
        if not console.is_terminal:
            yield lambda line: console.print(line, soft_wrap=True, highlight=False, markup=False)
            return
        with Progress(*columns, console=console, transient=True) as progress, told_above(console):
            task = progress.add_task("", total=None)
            yield lambda line: progress.update(task, description=line)


def _table(snapshot: Snapshot) -> RenderableType:
    points = snapshot.boundary.points
    columns = boundary_columns(points)
    table = Table(*columns, "running", title=escape(snapshot.boundary.name))
    for point in points:
        at = snapshot.boundary.place(point)
        values = sorted(task.value for task in snapshot.progress.running.values() if task.at == at)
        table.add_row(*boundary_cells(point, columns), ", ".join(f"{value:.6g}" for value in values))
    return for_people(table)


def _time_left(progress: JobProgress[Any]) -> str:
    if progress.seconds_left is None:
        return "time left unknown"
    return f"about {_duration(progress.seconds_left)} left"


def _duration(seconds: float) -> str:
    return str(timedelta(seconds=round(seconds)))


def _print_line(console: Console, progress: JobProgress[Any], message: str) -> None:
    elapsed, left = progress.elapsed, progress.seconds_left
    fraction = 0.0 if left is None else elapsed / (elapsed + left)
    reached = progress.runs + progress.known
    ProgressLine(fraction=fraction, message=message, reached=reached).print_on(console)


class _ChangedPoints:
    """Says which brackets or statuses have changed, with the progress of the whole study.

    A line fits into 80 columns if the names of the parameters are short.
    """

    def __init__(self) -> None:
        self._shown: dict[tuple[float, ...], str] = {}

    def since_the_last(self, snapshot: Snapshot) -> list[str]:
        """Return a line for each point that has changed since the last snapshot."""
        lines = []
        progress = snapshot.progress
        so_far = f"{progress.runs} runs, {len(progress.running)} running"
        left = "" if progress.seconds_left is None else f", {_duration(progress.seconds_left)} left"
        for point in snapshot.boundary.points:
            at = snapshot.boundary.place(point)
            line = f"{place_text(point.parameters)}: {bracket_text(point)} {point.status}"
            if point.runs and line != self._shown.get(at):
                self._shown[at] = line
                lines.append(f"{line}; {so_far}{left}")
        return lines
