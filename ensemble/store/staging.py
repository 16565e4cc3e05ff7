"""Where finished runs are written before they are committed.

Each process that stages runs has a directory of its own in `staging/`, whose lock it holds while it lives.  A
run is written as ``NAME.partial`` and renamed once all of it is on disk, so a directory without that suffix
is a whole run, also after a crash: the next process that opens the store to write commits it.
"""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING
from uuid import uuid4

from tenacity import Retrying, retry_if_exception_type, stop_after_delay, wait_exponential_jitter

from ensemble.disk import flush, flush_tree, locked
from ensemble.errors import StoreError
from ensemble.store.checkpoint import Checkpoint
from ensemble.store.run_record import RunSummary
from solver.analysis.run import Run

if TYPE_CHECKING:
    from solver.scene import Scene

RUNS = "runs"
STAGING = "staging"
STORE_LOCK = "store.lock"
WRITER_LOCK = "writer.lock"
PARTIAL = ".partial"
DISK_SECONDS = 60  # for which writing is tried again while the database or the disk does not take it

_NAME = re.compile(r"[0-9a-f]{32}")  # of directories that this module makes


@dataclass(frozen=True)
class Staged:
    """A run that is written but not committed.  It may be sent to the process that commits it.

    Attributes
    ----------
    directory : Path
    summary : RunSummary
    """

    directory: Path
    summary: RunSummary

    @property
    def key(self) -> str:
        """Key of the run."""
        return self.summary.key


class RunStaging(AbstractContextManager["RunStaging"]):
    """Writes runs for a store without opening its catalog, from any number of threads.

    Ranks other than the first have this instead of a store: they need no database connection.

    Parameters
    ----------
    store : Path
        Directory of the store.
    """

    def __init__(self, store: Path) -> None:
        # Resolved, so that a staged run means the same to a process in another working directory.
        self.path = store.resolve()
        self._directory = self.path / STAGING / uuid4().hex
        self._descriptor: int | None = None
        self._guard = threading.Lock()

    def stage(self, run: Run, summary: RunSummary | None = None) -> Staged:
        """Write a run to disk without committing it.

        Parameters
        ----------
        run : Run
            A finished run.
        summary : RunSummary, optional
            Of a run that another store has; left out, that of a run which this process has made.

        Returns
        -------
        Staged
            What `Store.commit` takes, in this process or another one.

        Raises
        ------
        StoreError
            If the run could not be written for `DISK_SECONDS`.  It is kept in the directory for temporary
            files, if it can be.
        """
        summary = RunSummary.of(run) if summary is None else summary
        try:
            return patiently(OSError)(self._stage_once, run, summary)
        except OSError as error:
            place = _kept_elsewhere(run, summary)
            kept = "is lost" if place is None else f"is kept in {place}: move it into {self.path / RUNS}"
            trouble = error.strerror or error
            raise StoreError(
                f"run {summary.key}: {self.path} does not take it ({trouble}), and it {kept}"
            ) from error

    def _stage_once(self, run: Run, summary: RunSummary) -> Staged:
        from ensemble.store.archive import write_run

        whole = self.directory() / uuid4().hex
        partial = whole.with_suffix(PARTIAL)
        try:
            write_run(partial, summary, run)
            flush_tree(partial)
            partial.rename(whole)
        except OSError:
            shutil.rmtree(partial, ignore_errors=True)  # its space may be what lacks
            raise
        flush(self._directory)
        return Staged(whole, summary)

    def checkpoint(self, scene: Scene) -> Checkpoint:
        """Return the checkpoint of a run.

        Parameters
        ----------
        scene : Scene
            Of the run.

        Returns
        -------
        Checkpoint
        """
        return Checkpoint(self.path, scene, self.directory)

    def directory(self) -> Path:
        """Return this process's directory; it is made if there is none.

        Returns
        -------
        Path
        """
        with self._guard:
            if self._descriptor is None:
                self._descriptor = self._register()
        return self._directory

    def close(self) -> None:
        """Remove this process's directory, unless a whole run in it waits to be committed."""
        with self._guard:
            if self._descriptor is None:
                return
            if not any(whole_runs(self._directory)):
                shutil.rmtree(self._directory, ignore_errors=True)
            os.close(self._descriptor)
            self._descriptor = None

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    def _register(self) -> int:
        # Under the store's lock no recovery meets the directory before its own lock is taken.
        with locked(self.path / STORE_LOCK):
            self._directory.mkdir(parents=True, exist_ok=True)  # an earlier try may have made it
            descriptor = os.open(self._directory / WRITER_LOCK, os.O_RDWR | os.O_CREAT, 0o666)
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        return descriptor


def patiently(*trouble: type[Exception]) -> Retrying:
    """Return what calls a function again while the disk or the database is in trouble.

    Parameters
    ----------
    *trouble : type
        Exceptions after which it is called again, for `DISK_SECONDS`.

    Returns
    -------
    Retrying
    """
    return Retrying(
        retry=retry_if_exception_type(trouble),
        stop=stop_after_delay(DISK_SECONDS),
        wait=wait_exponential_jitter(multiplier=0.1, max=5.0),
        reraise=True,
    )


def _kept_elsewhere(run: Run, summary: RunSummary) -> Path | None:
    """Write a run to the directory for temporary files, and return where; None if that fails, too."""
    from ensemble.store.archive import write_run

    try:
        place = Path(mkdtemp(prefix="ensemble-run-"), summary.key)
        write_run(place, summary, run)
    except OSError:
        return None
    return place


def whole_runs(directory: Path) -> Iterator[Path]:
    """Find the whole runs in the directory of one writer.

    Parameters
    ----------
    directory : Path
        A directory in `staging/`.

    Yields
    ------
    Path
        The directory of a run.
    """
    with suppress(FileNotFoundError):
        yield from (entry for entry in directory.iterdir() if is_own_directory(entry))


def is_own_directory(path: Path) -> bool:
    """Tell whether a path is a directory with a name as the store gives it: 32 hexadecimal digits.

    Parameters
    ----------
    path : Path
        An entry of `runs/`, of `staging/` or of a writer's directory.  Links do not count.

    Returns
    -------
    bool
    """
    return bool(_NAME.fullmatch(path.name)) and path.is_dir() and not path.is_symlink()


def abandoned(staging: Path) -> Iterator[Path]:
    """Find the directories of writers that no longer live.

    Parameters
    ----------
    staging : Path
        The directory `staging/` of a store, whose lock the caller holds.

    Returns
    -------
    iterator of Path
        Directories that writers made.  Everything else in `staging/` is left alone.
    """
    return (entry for entry in staging.iterdir() if is_own_directory(entry) and _has_no_writer(entry))


def _has_no_writer(directory: Path) -> bool:
    try:
        descriptor = os.open(directory / WRITER_LOCK, os.O_RDWR)
    except OSError:  # no lock file: not a writer's; or it belongs to somebody else
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    finally:
        os.close(descriptor)
    return True
