"""Verifies the runs of a store: some at once on several processes, and going on where it was interrupted."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import suppress
from datetime import datetime, timedelta
from itertools import islice
from pathlib import Path

from ensemble.errors import OtherVersionError
from ensemble.store.catalog_tables import Record
from ensemble.store.reading import validated
from ensemble.store.run_record import RunSummary
from ensemble.store.staging import RUNS
from ensemble.timestamp import now

NOTES = "unfinished-check"
NOTES_LAST = timedelta(days=1)  # a disk may damage a file at any time after it was verified
NOTED_EVERY = 5.0  # seconds; what takes less leaves no trace
AT_ONCE = 32  # runs that a process gets at once
ALONE = 256  # so few runs are verified before other processes have begun
PR_SET_PDEATHSIG = 1

Problems = list[str]
OnProgress = Callable[[int, int], None]


class CheckNotes:
    """Which runs a check has found whole, kept in the store while it goes on.

    A store that cannot be written to is checked without notes.

    Parameters
    ----------
    store : Path
        Directory of the store.

    Attributes
    ----------
    whole : frozenset of str
        Keys of the runs that a check which was interrupted has found whole, a day ago at most.
    """

    def __init__(self, store: Path) -> None:
        self._path = store / NOTES
        self.whole = self._read()
        self._waiting: list[str] = []
        self._written = time.monotonic()

    def add(self, key: str) -> None:
        """Note that a run is whole.

        Parameters
        ----------
        key : str
        """
        self._waiting.append(key)
        if time.monotonic() - self._written > NOTED_EVERY:
            self.write()

    def write(self) -> None:
        """Write down what is noted so far."""
        with suppress(OSError):
            begin = "" if self._path.exists() else f"{now().isoformat()}\n"
            with self._path.open("a", encoding="utf-8") as file:
                file.write(begin + "".join(f"{key}\n" for key in self._waiting))
        self._waiting.clear()
        self._written = time.monotonic()

    def remove(self) -> None:
        """Forget the notes: the check is finished."""
        with suppress(OSError):
            self._path.unlink(missing_ok=True)

    def _read(self) -> frozenset[str]:
        try:
            began, *keys = self._path.read_text(encoding="utf-8").splitlines()
            if now() - datetime.fromisoformat(began) < NOTES_LAST:
                return frozenset(keys)
        except (OSError, ValueError, TypeError):
            pass
        self.remove()
        return frozenset()


def run_problems(
    store: Path, records: Iterable[Record], processes: int = 1
) -> Iterator[tuple[str, Problems]]:
    """Verify runs: their files, and these with the rows of the catalog.

    Parameters
    ----------
    store : Path
        Directory of the store.
    records : iterable of Record
        Of the runs; they are read as they are needed.
    processes : int
        How many verify at once.  One that is killed takes the others along.

    Yields
    ------
    key : str
        Of a run, in the order of the records.
    problems : list of str
        One sentence each; empty if the run is whole.
    """
    remaining = iter(records)
    # Other processes take seconds to begin.
    yield from _verified(store / RUNS, islice(remaining, ALONE if processes > 1 else None))
    batches = iter(lambda: list(islice(remaining, AT_ONCE)), [])
    first = next(batches, None)
    if first is None:
        return
    context = multiprocessing.get_context("spawn")  # a fork would lack the threads of its parent
    executor = ProcessPoolExecutor(processes, context, _end_with_parent, (os.getpid(),))
    try:
        pending: deque[Future[list[tuple[str, Problems]]]] = deque()
        for batch in (first, *islice(batches, 2 * processes)):
            pending.append(executor.submit(_verify, store / RUNS, batch))
        while pending:
            yield from pending.popleft().result()
            for batch in islice(batches, 1):
                pending.append(executor.submit(_verify, store / RUNS, batch))
    finally:
        executor.shutdown(wait=False, cancel_futures=True)


def _verify(runs: Path, records: list[Record]) -> list[tuple[str, Problems]]:
    return list(_verified(runs, records))


def _verified(runs: Path, records: Iterable[Record]) -> Iterator[tuple[str, Problems]]:
    from ensemble.store.check import check_run

    for record in records:
        directory = runs / record.key
        try:
            summary = validated(RunSummary, "run", record)
        except OtherVersionError as error:
            yield record.key, [str(error)]
            continue
        # That a directory is missing is found by whoever compares the directory with the catalog.
        yield record.key, check_run(directory, summary) if directory.is_dir() else []


def _end_with_parent(parent: int) -> None:
    """Let this process end when the one that started it does; signals are for that one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        os._exit(1)
