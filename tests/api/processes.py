"""Processes that tests start, and what is left of them."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TypeVar
from uuid import uuid4

import psutil

SECONDS = 600  # until a process is given up; no test measures time by this
MARK = "ENSEMBLE_TEST_FAMILY"

Result = TypeVar("Result")


def run_python(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a piece of Python in a process of its own."""
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)


def wait_until(condition: Callable[[], Result], seconds: float = SECONDS) -> Result:
    """Wait until a condition returns something true, and return that.

    The processes that a condition asks for may appear and end at any moment. As long as one that it needs is
    missing (`LookupError`) or has just ended (`psutil.NoSuchProcess`), the condition is not met.
    """
    deadline = time.monotonic() + seconds
    while True:
        unmet: Exception | None = None
        try:
            if result := condition():
                return result
        except (LookupError, psutil.NoSuchProcess) as error:
            unmet = error
        if time.monotonic() > deadline:
            raise TimeoutError(f"not met within {seconds:g} s") from unmet
        time.sleep(0.05)


def alive(processes: Sequence[psutil.Process]) -> list[psutil.Process]:
    """Return the processes that run.

    One that has ended and only waits to be reaped does not.  While other threads of it still end, it holds
    its files and their locks.
    """
    return [process for process in processes if process.is_running() and not _is_zombie(process)]


def _is_zombie(process: psutil.Process) -> bool:
    try:
        return bool(process.status() == psutil.STATUS_ZOMBIE) and process.num_threads() <= 1
    except psutil.NoSuchProcess:
        return True


class Family:
    """A worker and all its descendants, whatever their sessions and parents: they inherit a variable."""

    def __init__(self, store: Path, *options: str) -> None:
        self._mark = uuid4().hex
        self.worker = subprocess.Popen(
            [sys.executable, "-m", "ensemble", "worker", "--store", str(store), *options],
            env=os.environ | {MARK: self._mark},
            stdin=subprocess.PIPE,
        )

    def members(self) -> list[psutil.Process]:
        """Return all that run, the worker included."""
        return alive([process for process in psutil.process_iter() if self._has_mark(process)])

    def _has_mark(self, process: psutil.Process) -> bool:
        try:
            return process.environ().get(MARK) == self._mark
        except psutil.Error:
            return False

    def descendants(self) -> list[psutil.Process]:
        """Return all that run except the worker."""
        return [process for process in self.members() if process.pid != self.worker.pid]

    def launcher(self) -> psutil.Process:
        """Return the `mpirun` of the job."""
        return self._first(lambda process: process.name().startswith("mpi"))

    def watcher(self) -> psutil.Process:
        """Return the process between the worker and the launcher."""
        return self._first(lambda process: "api.worker.watcher" in process.cmdline())

    def rank(self, number: int) -> psutil.Process:
        """Return one of the processes that simulate."""
        return self._first(lambda process: process.environ().get("PMI_RANK") == str(number))

    def helper(self) -> psutil.Process:
        """Return the launcher's helper, which has started the ranks."""
        return self.rank(0).parent()

    def _first(self, is_wanted: Callable[[psutil.Process], bool]) -> psutil.Process:
        """Return the first descendant that is wanted; `LookupError` if there is none at the moment."""
        for process in self.descendants():
            with suppress(psutil.NoSuchProcess):
                if is_wanted(process):
                    return process
        raise LookupError("no such process at the moment")

    def end(self) -> None:
        """Kill all of them."""
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
