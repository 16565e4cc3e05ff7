"""The store as its users see it.

What reads and writes arrays is imported by the methods that do so: it takes long, and most who open a store
want its catalog.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from pydantic import ValidationError
from sqlalchemy.exc import DatabaseError

from ensemble.disk import flush, flush_tree, locked
from ensemble.errors import NotStored, StoreInputError
from ensemble.search.boundary import Boundary
from ensemble.store.catalog import Catalog, Record
from ensemble.store.run_record import RunSummary
from ensemble.store.sql_database import CATALOG, PLACE, UNUSABLE, Place, reason
from ensemble.store.staging import Writer, abandoned
from solver.analysis.run import Outcome, Run

LOCK = "store.lock"
RUNS = "runs"
STAGING = "staging"


@dataclass(frozen=True)
class Staged:
    """A run that is written but not committed.  It may be sent to the process that commits it."""

    directory: Path
    summary: RunSummary

    @property
    def key(self) -> str:
        """Key of the run."""
        return self.summary.key


class Store(AbstractContextManager["Store"]):
    """Runs and boundaries in a directory, for any number of processes and threads at once.

    Get one from `Store.open` or `Store.existing` and use it as a context manager.  A process that stages runs
    for another one to commit keeps its store open until they are committed: closing removes them.

    Parameters
    ----------
    path : Path
        The directory.
    """

    def __init__(self, path: Path) -> None:
        # Resolved, so that a staged run means the same to a process in another working directory.
        self.path = path.resolve()
        self._runs = self.path / RUNS
        self._staging = self.path / STAGING
        self._lock = self.path / LOCK
        self._catalog = Catalog(Place.of(self.path))
        self._writer = Writer(self._staging, self._lock)

    @classmethod
    def open(cls, path: Path) -> Self:
        """Open a store to write to: create it if there is none, and sweep it.

        A new one has its catalog in a file, or on the server that `ensemble.store.sql_database` tells of.

        Raises
        ------
        StoreInputError
            If the path is a file, a directory with other contents, or cannot be created, or if the database
            cannot be used.
        """
        if not _exists(path):
            _create(path)
        with _refused(path):
            store = cls(path)
            store.sweep()
        return store

    @classmethod
    def existing(cls, path: Path) -> Self:
        """Open a store that must be there; nothing is created and nothing swept.

        Raises
        ------
        StoreInputError
            If there is no store at the path, or the database cannot be used.
        """
        if not _exists(path):
            raise StoreInputError(f"store: there is no store at {path}")
        with _refused(path):
            store = cls(path)
            store._catalog.keys()
        return store

    def close(self) -> None:
        """Drop what this process staged and did not commit, and close the catalog."""
        self._writer.close()
        self._catalog.close()

    def __exit__(self, *_: object) -> None:
        self.close()

    def stage(self, run: Run) -> Staged:
        """Write a run to disk without committing it; any process may."""
        from ensemble.store.archive import write_run

        staged = Staged(self._writer.place(), RunSummary.of(run))
        write_run(staged.directory, staged.summary, run)
        flush_tree(staged.directory)
        return staged

    def commit(self, staged: Staged) -> str:
        """Make a staged run exist, and return its key.

        If the key exists already, that run stays and the staged copy is removed.
        """
        destination = self._runs / staged.key
        with locked(self._lock):
            if self.contains(staged.key):
                shutil.rmtree(staged.directory, ignore_errors=True)
                return staged.key
            if destination.exists():
                # Of a process that died between the rename and the catalog.
                shutil.rmtree(destination)
            os.rename(staged.directory, destination)
            flush(self._runs)
            self._catalog.insert(staged.summary)
        return staged.key

    def save(self, run: Run) -> str:
        """Stage and commit a run, and return its key."""
        return self.commit(self.stage(run))

    def sweep(self) -> None:
        """Remove what dead processes left behind."""
        with locked(self._lock):
            for leftover in self._leftovers():
                shutil.rmtree(leftover)

    def _leftovers(self) -> Iterator[Path]:
        committed = self._catalog.keys()
        yield from (entry for entry in self._runs.iterdir() if entry.name not in committed)
        yield from abandoned(self._staging)

    def contains(self, key: str) -> bool:
        """Tell whether a run is committed."""
        return self._catalog.run(key) is not None

    def outcome(self, key: str) -> Outcome | None:
        """Outcome of a committed run, None if there is none."""
        record = self._catalog.run(key)
        return None if record is None else Outcome(json.loads(record.json)["outcome"])

    def summary(self, key: str) -> RunSummary:
        """Everything about a committed run except its arrays.

        Raises
        ------
        NotStored
            If there is no such run.
        """
        return RunSummary.model_validate_json(self.run_record(key).json)

    def run_record(self, key: str) -> Record:
        """What `summary` reads, as it was recorded.

        Raises
        ------
        NotStored
            If there is no such run.
        """
        record = self._catalog.run(key)
        if record is None:
            raise NotStored(f"run: there is no run {key} in {self.path}")
        return record

    def load(self, key: str) -> Run:
        """Read a committed run; every number has the bits that were saved.

        Raises
        ------
        NotStored
            If there is no such run.
        StoreError
            If its files are damaged.
        """
        from ensemble.store.archive import read_run

        if not self.contains(key):
            raise NotStored(f"run: there is no run {key} in {self.path}")
        return read_run(self._runs / key)

    def summaries(self, where: Sequence[str] = ()) -> list[RunSummary]:
        """Summaries of the runs that meet all filters, oldest first.

        Parameters
        ----------
        where : sequence of str
            Filters ``path op value`` over the scene (``flow.rate>=0.5``, ``vesicles.0.reduced_area=0.9``,
            ``adhesion=null``) and the results (``outcome!=bound``, ``viscosity.total<2``).

        Raises
        ------
        StoreInputError
            If a filter is malformed, or its field or value is none.
        """
        return [RunSummary.model_validate_json(record.json) for record in self._catalog.runs(where)]

    def runs_page(
        self, where: Sequence[str] = (), after: str | None = None, limit: int = 100
    ) -> list[Record]:
        """A part of what `summaries` finds, newest first, as it was recorded.

        Parameters
        ----------
        where : sequence of str
            Filters, as `summaries` takes them.
        after : str, optional
            Key of the last run of the part before; left out, the newest run is the first.
        limit : int
            How many runs at most.

        Raises
        ------
        StoreInputError
            If a filter is malformed, its field or value is none, or there is no run `after`.
        """
        if after is not None and not self.contains(after):
            raise StoreInputError(f"after: there is no run {after}")
        return self._catalog.runs_page(where, after, limit)

    def save_boundary(self, boundary: Boundary) -> None:
        """Insert a boundary, or replace the one of the same study, at once."""
        with locked(self._lock):
            self._catalog.put_boundary(boundary)

    def boundaries(self, where: Sequence[str] = ()) -> list[Boundary]:
        """Boundaries that meet all filters, such as ``name=critical-hamaker``; the latest change last.

        Raises
        ------
        StoreInputError
            If a filter is malformed, or its field or value is none.
        """
        return [Boundary.model_validate_json(record.json) for record in self._catalog.boundaries(where)]

    def boundary(self, study_key: str) -> Boundary:
        """Boundary of one study.

        Raises
        ------
        NotStored
            If there is none.
        """
        return Boundary.model_validate_json(self.boundary_record(study_key).json)

    def boundary_record(self, study_key: str) -> Record:
        """What `boundary` reads, as it was recorded.

        Raises
        ------
        NotStored
            If there is none.
        """
        record = self._catalog.boundary(study_key)
        if record is None:
            raise NotStored(f"boundary: there is no boundary {study_key} in {self.path}")
        return record

    def boundaries_page(
        self, where: Sequence[str] = (), after: str | None = None, limit: int = 100
    ) -> list[Record]:
        """A part of what `boundaries` finds, by ascending key, as it was recorded.

        Parameters
        ----------
        where : sequence of str
            Filters, as `boundaries` takes them.
        after : str, optional
            Key of the last study of the part before.
        limit : int
            How many boundaries at most.

        Raises
        ------
        StoreInputError
            If a filter is malformed, or its field or value is none.
        """
        return self._catalog.boundaries_page(where, after, limit)

    def check(self) -> list[str]:
        """Verify every run and boundary.

        What a dead process left behind without committing it was never part of the store, so it is no
        problem; the next `open` sweeps it.

        Returns
        -------
        list of str
            Problems, one sentence each; empty if the store is whole.
        """
        from ensemble.store.check import check_run

        try:
            summaries = self.summaries()
            self.boundaries()
        except (DatabaseError, ValidationError) as error:
            return [f"the catalog cannot be read ({error})"]
        return [problem for summary in summaries for problem in check_run(self._runs / summary.key, summary)]


def _exists(path: Path) -> bool:
    # Made last, so where it is the store is whole.
    return (path / STAGING).is_dir()


def _create(path: Path) -> None:
    if path.exists() and not path.is_dir():
        raise StoreInputError(f"store: {path} is a file; give a directory")
    with _refused(path):
        path.mkdir(parents=True, exist_ok=True)
        # Sweeping removes what it does not know: a directory of anything else must never become a store.
        foreign = {entry.name for entry in path.iterdir()} - {LOCK}
        if foreign and not foreign & {CATALOG, PLACE}:
            raise StoreInputError(
                f"store: {path} is no store and already holds {min(foreign)}; give a new directory"
            )
        with locked(path / LOCK):
            place = Place.choose(path)
            with closing(Catalog(place)) as catalog:
                catalog.create()
            place.keep(path)
            for directory in (RUNS, STAGING):
                (path / directory).mkdir(exist_ok=True)
            flush(path)


@contextmanager
def _refused(path: Path) -> Iterator[None]:
    """Say of a store that cannot be opened that it cannot."""
    try:
        yield
    except (OSError, *UNUSABLE) as error:
        raise StoreInputError(f"store: {path} cannot be opened ({reason(error)})") from error
