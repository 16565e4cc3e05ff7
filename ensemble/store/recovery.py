"""What becomes of runs that are in the directory of a store but not in its catalog, and the other way round.

Nothing that holds data is deleted.  A whole run without a row is adopted: its row is written.  What is no
whole run is moved to `lost+found/`.  Only the unfinished staging of a dead process is removed, the checkpoint
of a run that is committed, and the record of an unfinished one that no checkpoint counts.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

from ensemble.disk import flush
from ensemble.errors import OtherVersionError, StoreError
from ensemble.store.catalog import Catalog
from ensemble.store.checkpoint import (
    remove_checkpoint,
    sweep_blocks,
    unfinished_keys,
)
from ensemble.store.run_record import RunSummary
from ensemble.store.staging import RUNS, whole_runs
from ensemble.store.writers import STAGING, abandoned, is_own_directory

LOST_AND_FOUND = "lost+found"


class Recovery:
    """Brings the directory and the catalog of a store together.  The caller holds the store's lock.

    Parameters
    ----------
    path : Path
        Directory of the store.
    catalog : Catalog
        Its catalog.
    """

    def __init__(self, path: Path, catalog: Catalog) -> None:
        self._path = path
        self._runs = path / RUNS
        self._catalog = catalog

    def recover(self) -> list[str]:
        """Adopt whole runs, set aside what is not one, and remove what dead processes left unfinished.

        That is their staging, checkpoints of runs that are committed, and what was recorded after the
        checkpoints of others.

        Returns
        -------
        list of str
            What was done, one clause each.
        """
        done: list[str] = []
        committed = self._catalog.keys()
        adopted = [self._adopt(directory, done) for directory in self._uncataloged(committed)]
        if any(adopted):
            committed = self._catalog.keys()
        for writer in abandoned(self._path / STAGING):
            adopted += [self._adopt_staged(directory, committed) for directory in whole_runs(writer)]
            shutil.rmtree(writer)
        for key in unfinished_keys(self._path):
            if key in committed:  # the process that committed it died before it could remove this
                remove_checkpoint(self._path, key)
            else:
                sweep_blocks(self._path, key)
        if sum(adopted):
            done.append(f"adopted {sum(adopted)} runs that were not in the catalog of {self._path}")
        return done

    def set_aside(self, directory: Path) -> Path:
        """Move a run, or what looks like one, to `lost+found/`.

        Parameters
        ----------
        directory : Path
            An entry of the store.

        Returns
        -------
        Path
            Where it is now.
        """
        shelf = self._path / LOST_AND_FOUND
        shelf.mkdir(exist_ok=True)
        place = shelf / directory.name
        while place.exists():
            place = shelf / f"{directory.name}-{uuid4().hex[:8]}"
        os.rename(directory, place)
        flush(shelf)
        flush(directory.parent)
        return place

    def differences(self) -> list[str]:
        """Name what is in the directory and not in the catalog, and the other way round.

        Returns
        -------
        list of str
            One sentence each.
        """
        committed = self._catalog.keys()
        return [
            *(
                f"run {directory.name}: it is in {RUNS}/ and not in the catalog"
                for directory in self._uncataloged(committed)
            ),
            *(
                f"run {key}: it is in the catalog and not in {RUNS}/"
                for key in sorted(committed)
                if not (self._runs / key).is_dir()
            ),
        ]

    def _uncataloged(self, committed: set[str]) -> Iterator[Path]:
        entries = sorted(entry for entry in self._runs.iterdir() if entry.name not in committed)
        return filter(is_own_directory, entries)

    def _adopt(self, directory: Path, done: list[str]) -> bool:
        """Enter a run of `runs/` into the catalog if it is whole, else move it away and say so."""
        try:
            summary = _whole_run(directory)
            if summary.key != directory.name:
                raise StoreError(f"run {directory.name}: it is run {summary.key}")
        except OtherVersionError as error:
            done.append(f"{error}; left where it is")
            return False
        except StoreError as error:
            done.append(f"{error}; moved to {self.set_aside(directory)}")
            return False
        self._catalog.insert([summary])
        return True

    def _adopt_staged(self, directory: Path, committed: set[str]) -> bool:
        """Commit a run that a process staged before it died; a torn one is left to be removed."""
        try:
            summary = _whole_run(directory)
        except StoreError:
            return False
        if summary.key in committed:
            return False
        os.rename(directory, self._runs / summary.key)
        flush(self._runs)
        self._catalog.insert([summary])
        committed.add(summary.key)
        return True


def _whole_run(directory: Path) -> RunSummary:
    """Return the summary that a run's own files hold.

    Raises
    ------
    StoreError
        If they are not those of a whole run.
    """
    from ensemble.store.archive import StoredArrays
    from ensemble.store.check import array_problems

    stored = StoredArrays(directory)
    problems = array_problems(stored.run())
    if problems:
        raise StoreError(f"run {directory.name}: {problems[0]}")
    return stored.summary
