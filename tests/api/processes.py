"""Processes that tests start, and what is left of them."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

import psutil

SECONDS = 120
MARK = "ENSEMBLE_TEST_FAMILY"


def run_python(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a piece of Python in a process of its own."""
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)


def wait_until(condition: Callable[[], object], seconds: float = SECONDS) -> float:
    """Wait for a condition and return how many seconds it took."""
    begin = time.monotonic()
    while not condition():
        assert time.monotonic() - begin < seconds, "it has not come about"
        time.sleep(0.02)
    return time.monotonic() - begin


def alive(processes: Sequence[psutil.Process]) -> list[psutil.Process]:
    """Those that still run: one that waits for its parent, or for init, to take note of its end does not."""
    return [process for process in processes if process.is_running() and not _is_zombie(process)]


def _is_zombie(process: psutil.Process) -> bool:
    try:
        return bool(process.status() == psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return True


class Family:
    """A worker and every process that comes of it, wherever those have gone: they inherit a mark."""

    def __init__(self, store: Path, *options: str) -> None:
        self._mark = uuid4().hex
        self.worker = subprocess.Popen(
            [sys.executable, "-m", "ensemble", "worker", "--store", str(store), *options],
            env=os.environ | {MARK: self._mark},
            stdin=subprocess.PIPE,
        )

    def members(self) -> list[psutil.Process]:
        """All that live, the worker included."""
        return alive([process for process in psutil.process_iter() if self._has_mark(process)])

    def _has_mark(self, process: psutil.Process) -> bool:
        try:
            return process.environ().get(MARK) == self._mark
        except psutil.Error:
            return False

    def descendants(self) -> list[psutil.Process]:
        """All that live but the worker."""
        return [process for process in self.members() if process.pid != self.worker.pid]

    def launcher(self) -> psutil.Process:
        """The `mpirun` of the job."""
        return self._first(lambda process: process.name().startswith("mpi"))

    def watcher(self) -> psutil.Process:
        """The process between the worker and the launcher."""
        return self._first(lambda process: "api.worker.watcher" in process.cmdline())

    def rank(self, number: int) -> psutil.Process:
        """One of the processes that simulate."""
        return self._first(lambda process: process.environ().get("PMI_RANK") == str(number))

    def helper(self) -> psutil.Process:
        """The launcher's helper, which has started the ranks."""
        return self.rank(0).parent()

    def _first(self, which: Callable[[psutil.Process], bool]) -> psutil.Process:
        return next(process for process in self.descendants() if which(process))

    def end(self) -> None:
        """Kill all of it."""
        for process in self.members():
            process.kill()
        self.worker.stdin.close()
        self.worker.wait()


@contextmanager
def working(store: Path, *options: str) -> Iterator[Family]:
    """Run a worker beside the test."""
    family = Family(store, *options)
    try:
        yield family
    finally:
        family.end()
