"""Where finished runs are written before they are committed.

Each process that stages runs has a directory of its own in `staging/`, whose lock it holds while it lives.  A
run is written as ``NAME.partial`` and renamed once all of it is on disk, so a directory without that suffix
is a whole run, also after a crash: the next process that opens the store to write commits it.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import threading
from collections.abc import Iterator, Mapping
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
from ensemble.store.run_record import NamedArray, RunSummary, arrays, named_arrays
from ensemble.store.writers import STAGING, WRITER_LOCK, is_own_directory

if TYPE_CHECKING:
    from ensemble.store.recorded_blocks import RecordedBlocks
    from solver.analysis.run import Run, RunResults
    from solver.scene import Scene

RUNS = "runs"
STORE_LOCK = "store.lock"
PARTIAL = ".partial"
DISK_SECONDS = 60  # for which writing is tried again while the database or the disk does not take it


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
    report : str, optional
        Name of the report that its runs are made for.
    """

    def __init__(self, store: Path, report: str | None = None) -> None:
        self._report = report
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
        return self._stage(self._own(RunSummary.of(run)) if summary is None else summary, arrays(run))

    def stage_recorded(self, results: RunResults, record: RecordedBlocks) -> Staged:
        """Write a run to disk of which this process has recorded the arrays; see `stage`.

        Parameters
        ----------
        results : RunResults
        record : RecordedBlocks
            Its files are removed.

        Returns
        -------
        Staged

        Raises
        ------
        StoreError
            As of `stage`, or if a file of the record is damaged.
        """
        parts = record.parts(results.work.points)
        staged = self._stage(
            self._own(RunSummary.of_parts(results, parts["series"], parts.get("vesicle_series", ()))),
            named_arrays(parts, results.scene.units),
        )
        record.remove()
        return staged

    def _own(self, summary: RunSummary) -> RunSummary:
        """Return the summary of a run that this process has made, with the report that it is for."""
        return summary.model_copy(update={"report": self._report})

    def _stage(self, summary: RunSummary, named: Mapping[str, NamedArray]) -> Staged:
        try:
            return patiently(OSError)(self._stage_once, summary, named)
        except OSError as error:
            place = _kept_elsewhere(summary, named)
            kept = "is lost" if place is None else f"is kept in {place}: move it into {self.path / RUNS}"
            trouble = error.strerror or error
            raise StoreError(
                f"run {summary.key}: {self.path} does not take it ({trouble}), and it {kept}"
            ) from error

    def _stage_once(self, summary: RunSummary, named: Mapping[str, NamedArray]) -> Staged:
        from ensemble.store.zarr_groups import write_group

        whole = self.directory() / uuid4().hex
        partial = whole.with_suffix(PARTIAL)
        try:
            write_group(partial, summary.document(), named)
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


def _kept_elsewhere(summary: RunSummary, named: Mapping[str, NamedArray]) -> Path | None:
    """Write a run to the directory for temporary files, and return where; None if that fails, too."""
    from ensemble.store.zarr_groups import write_group

    try:
        place = Path(mkdtemp(prefix="ensemble-run-"), summary.key)
        write_group(place, summary.document(), named)
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
