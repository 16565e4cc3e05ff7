"""The store as its users see it.

The modules that read and write arrays are imported by the methods that need them.  Their import takes long,
and most users of a store need only its catalog.
"""

from __future__ import annotations

import json
import logging
import os
import shutil
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from functools import cached_property
from itertools import islice
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from sqlalchemy.exc import DatabaseError

from ensemble.config.dotted_paths import number_at
from ensemble.disk import flush, locked
from ensemble.errors import NotStored, OtherVersionError, StoreError, StoreInputError
from ensemble.search.boundary import Boundary
from ensemble.search.task_queue import RunAnswer
from ensemble.store.catalog import Catalog
from ensemble.store.catalog_tables import Record
from ensemble.store.checkpoint import Checkpoint, remove_checkpoint
from ensemble.store.listing import Listing, ParameterRange
from ensemble.store.reading import readable, validated
from ensemble.store.recovery import Recovery
from ensemble.store.run_record import RunSummary
from ensemble.store.sql_database import UNUSABLE, Place, reason
from ensemble.store.staging import RUNS, STORE_LOCK, RunStaging, Staged, patiently
from ensemble.store.store_directory import create, exists, refused, require_catalog, require_writable
from ensemble.store.writers import STAGING
from solver.analysis.run import Configuration, Outcome, Run

if TYPE_CHECKING:
    from pydantic import BaseModel

    from ensemble.search.branch_summary import BranchSummary
    from ensemble.search.map_record import MapRecord
    from ensemble.store.archive import StoredArrays
    from ensemble.store.branch_shelf import BranchShelf
    from ensemble.store.grid_shelf import GridShelf
    from ensemble.store.recorded_blocks import RecordedBlocks
    from ensemble.store.run_record import NamedArray
    from ensemble.store.shelf import Shelf
    from ensemble.store.verification import OnProgress
    from solver.analysis.run import RunResults
    from solver.scene import Scene
    from solver.simulation.steady_scenes import SteadyBranch

BOUNDARIES = "boundaries"
MAPS = "maps"

_CANDIDATES = 5  # keys that a message about an ambiguous one names

_log = logging.getLogger(__name__)


class Store(AbstractContextManager["Store"]):
    """Runs and boundaries in a directory, for any number of processes and threads at once.

    Get one from `Store.open` or `Store.existing` and use it as a context manager.  A process that stages runs
    for another one to commit keeps its store open until they are committed.

    Parameters
    ----------
    path : Path
        The directory.
    read_only : bool
        Whether this process only reads: then it leaves no trace.
    report : str, optional
        Name of the report that the runs of this process are made for.
    """

    def __init__(self, path: Path, read_only: bool = False, report: str | None = None) -> None:
        self.path = path.resolve()
        self._runs = self.path / RUNS
        self._lock = self.path / STORE_LOCK
        self._catalog = Catalog(Place.of(self.path), read_only)
        self._staging = RunStaging(self.path, report)
        self._recovery = Recovery(self.path, self._catalog)

    @classmethod
    def open(cls, path: Path, report: str | None = None) -> Self:
        """Open a store to write to: create it if there is none, and adopt what processes left in it.

        A new one has its catalog in a file, or on the server that `ensemble.store.sql_database` describes.

        Parameters
        ----------
        path : Path
            The directory.
        report : str, optional
            Name of the report that the runs of this process are made for.

        Returns
        -------
        Store

        Raises
        ------
        StoreInputError
            If the path is a file, a directory with other contents, or cannot be created or written to, or if
            the database cannot be used.
        """
        if not exists(path):
            create(path)
        with refused(path):
            require_writable(path)
            require_catalog(path)
            (path / STAGING).mkdir(exist_ok=True)  # a copy may lack it
            store = cls(path, report=report)
            store._catalog.require_writable()
            for line in store.recover():
                _log.warning("store: %s", line)
        return store

    @classmethod
    def existing(cls, path: Path) -> Self:
        """Open a store that must be there, to read it; nothing is created and nothing changes.

        Parameters
        ----------
        path : Path
            The directory.

        Returns
        -------
        Store

        Raises
        ------
        StoreInputError
            If there is no store at the path, or the database cannot be used.
        """
        if not exists(path):
            raise StoreInputError(f"store: there is no store at {path}")
        with refused(path):
            require_catalog(path)
            store = cls(path, read_only=True)
            store._catalog.require_readable()
        return store

    def require_usable(self) -> None:
        """Raise an error unless runs could be written and the catalog be read now.

        Raises
        ------
        OSError
            If the directory is gone, full, or not to be written to.
        sqlalchemy.exc.SQLAlchemyError
            If the catalog does not answer.
        """
        require_writable(self.path)
        require_catalog(self.path)
        self._catalog.boundaries_page((), None, 1)

    def close(self) -> None:
        """Close the catalog.  Whole runs that this process staged stay for the next one to adopt."""
        self._staging.close()
        self._catalog.close()

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    def stage(self, run: Run, summary: RunSummary | None = None) -> Staged:
        """Write a run to disk without committing it; see `RunStaging.stage`.

        Parameters
        ----------
        run : Run
            A finished run.
        summary : RunSummary, optional
            Of a run that another store has.

        Returns
        -------
        Staged
        """
        return self._staging.stage(run, summary)

    def stage_recorded(self, results: RunResults, record: RecordedBlocks) -> Staged:
        """Write a run of which this process has recorded the arrays; see `RunStaging.stage_recorded`.

        Parameters
        ----------
        results : RunResults
        record : RecordedBlocks

        Returns
        -------
        Staged
        """
        return self._staging.stage_recorded(results, record)

    def checkpoint(self, scene: Scene) -> Checkpoint:
        """Return the checkpoint of a run; see `RunStaging.checkpoint`.

        Parameters
        ----------
        scene : Scene
            Of the run.

        Returns
        -------
        Checkpoint
        """
        return self._staging.checkpoint(scene)

    def commit(self, staged: Staged) -> str:
        """Commit a staged run; see `commit_all`.

        Parameters
        ----------
        staged : Staged
            From `stage`, of this process or another one.

        Returns
        -------
        str
            Key of the run.

        Raises
        ------
        StoreError
            If the run could not be committed.
        """
        self.commit_all([staged])
        return staged.key

    def commit_all(self, staged: Sequence[Staged]) -> None:
        """Commit staged runs: from then on they exist, and their checkpoints are removed.

        Together they take hardly longer than one, which waits for the disk most of the time.  If a key exists
        already, that run stays and the staged copy is removed.  While the database or the disk does not
        answer the commit is tried again for `ensemble.store.staging.DISK_SECONDS`.

        Parameters
        ----------
        staged : sequence of Staged
            From `stage`, of this process or other ones.

        Raises
        ------
        StoreError
            If the runs could not be committed.  They stay where they are and the next process that opens the
            store to write adopts them.
        """
        try:
            patiently(OSError, *UNUSABLE)(self._commit_once, staged)
        except (OSError, *UNUSABLE) as error:
            keys = ", ".join(each.key for each in staged)
            raise StoreError(
                f"run {keys}: it could not be committed ({reason(error)}); it is kept in {self.path} "
                "and the next command that writes there adopts it"
            ) from error

    def _commit_once(self, staged: Sequence[Staged]) -> None:
        with locked(self._lock):
            new: dict[str, Staged] = {}
            for each in staged:
                if each.key in new or self.contains(each.key):
                    shutil.rmtree(each.directory, ignore_errors=True)
                else:
                    new[each.key] = each
                    self._put_in_place(each)
            if new:
                flush(self._runs)
                self._catalog.insert(each.summary for each in new.values())
            for each in staged:
                remove_checkpoint(self.path, each.key)

    def _put_in_place(self, staged: Staged) -> None:
        if not staged.directory.exists():  # an earlier attempt has moved it
            return
        destination = self._runs / staged.key
        if destination.exists():
            # Of a process that died between the rename and the catalog; damaged perhaps.
            self._recovery.set_aside(destination)
        os.rename(staged.directory, destination)

    def save(self, run: Run, summary: RunSummary | None = None) -> str:
        """Stage and commit a run.

        Parameters
        ----------
        run : Run
            A finished run.
        summary : RunSummary, optional
            Of a run that another store has.

        Returns
        -------
        str
            Key of the run.
        """
        return self.commit(self.stage(run, summary))

    def recover(self) -> list[str]:
        """Bring directory and catalog together; see `ensemble.store.recovery`.

        Returns
        -------
        list of str
            What was done, one clause each; empty if there was nothing to do.
        """
        with locked(self._lock):
            return self._recovery.recover()

    def set_aside(self, key: str) -> Path:
        """Take a run out of the store, so that it can be made again, and keep its files.

        Parameters
        ----------
        key : str
            Of a committed run.

        Returns
        -------
        Path
            Where its files are now.

        Raises
        ------
        NotStored
            If there is no such run.
        """
        self.run_record(key)
        with locked(self._lock):
            return self._set_aside(key)

    def _set_aside(self, key: str) -> Path:
        # The row goes last: a process that dies in between leaves a row without files, which `check` names.
        place = (
            self._recovery.set_aside(self._runs / key) if (self._runs / key).exists() else self._runs / key
        )
        self._catalog.remove(key)
        return place

    def count_runs(self) -> int:
        """Return how many runs are committed."""
        return self._catalog.count_runs()

    def contains(self, key: str) -> bool:
        """Tell whether a run is committed.

        Parameters
        ----------
        key : str

        Returns
        -------
        bool
        """
        return self._catalog.run(key) is not None

    def full_key(self, beginning: str) -> str:
        """Return the key of the only run whose key begins so.

        Parameters
        ----------
        beginning : str
            The first characters of the key, or all of it.

        Returns
        -------
        str

        Raises
        ------
        NotStored
            If there is no such run, or it has not ended; then the message says how far it is.
        StoreInputError
            If there are several; names some of them.
        UnfinishedRunError
            If it has not ended, and cannot go on from its checkpoint.
        """
        from ensemble.store.unfinished import unfinished_run

        keys = self._catalog.keys_from(beginning, _CANDIDATES) if beginning else []
        if not keys:
            if unfinished := unfinished_run(self.path, beginning):
                raise NotStored(
                    f"run: {unfinished.key} has not ended: {unfinished.status} {unfinished.progress}"
                )
            raise NotStored(f"run: there is no run {beginning} in {self.path}")
        if len(keys) > 1:
            raise StoreInputError(f"run: {beginning} is the beginning of several keys: {', '.join(keys)}")
        return keys[0]

    def answer(self, key: str) -> RunAnswer | None:
        """Return what a committed run has come to.

        Parameters
        ----------
        key : str

        Returns
        -------
        RunAnswer or None
            None if there is no such run.
        """
        record = self._catalog.run(key)
        if record is None:
            return None
        document = json.loads(record.json)
        # Records of before do not say whether they are sensitive, or have no configuration.
        configuration = document.get("configuration")
        return RunAnswer(
            Outcome(document["outcome"]),
            document.get("sensitive", False),
            configuration and Configuration(configuration),
        )

    def summary(self, key: str) -> RunSummary:
        """Return everything about a committed run except its arrays.

        Parameters
        ----------
        key : str

        Returns
        -------
        RunSummary

        Raises
        ------
        NotStored
            If there is no such run.
        """
        return validated(RunSummary, "run", self.run_record(key))

    def run_record(self, key: str) -> Record:
        """Return the summary of a committed run as it was recorded.

        Parameters
        ----------
        key : str

        Returns
        -------
        Record

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

        Parameters
        ----------
        key : str

        Returns
        -------
        Run

        Raises
        ------
        NotStored
            If there is no such run.
        StoreError
            If its files are damaged.
        """
        return self.arrays(key).run()

    def arrays(self, key: str) -> StoredArrays:
        """Open the arrays of a committed run, to read some of their rows.

        Parameters
        ----------
        key : str

        Returns
        -------
        StoredArrays

        Raises
        ------
        NotStored
            If there is no such run.
        StoreError
            If its files are damaged.
        """
        from ensemble.store.archive import StoredArrays

        self.run_record(key)
        return StoredArrays(self._runs / key)

    def summaries(self, where: Sequence[str] = ()) -> list[RunSummary]:
        """Return the summaries of the runs that meet all filters, oldest first.

        A record that this version cannot read is left out, with a warning that names it.

        Parameters
        ----------
        where : sequence of str
            Filters ``path op value`` over the scene (``flow.rate>=0.5``, ``vesicles.0.reduced_area=0.9``,
            ``adhesion=null``) and the results (``outcome!=bound``, ``viscosity.total<2``).

        Returns
        -------
        list of RunSummary

        Raises
        ------
        StoreInputError
            If a filter is malformed, its field is unknown, or the value does not have its type.
        """
        listing = Listing(tuple(where), sort="created")
        return list(readable(RunSummary, "run", self._catalog.runs(listing)))

    def parameters_within(self, *ranges: ParameterRange) -> Iterator[tuple[float, ...]]:
        """Find the numbers that runs have as some parameters of their scenes.

        The database compares, so that the documents of other runs are not read.

        Parameters
        ----------
        *ranges : ParameterRange
            The parameters, and which of their values count.

        Yields
        ------
        tuple of float
            Each combination of their values in a run, to the last bit.
        """
        for record in self._catalog.runs_within(ranges):
            scene = json.loads(record.json)["scene"]
            with suppress(ValueError):  # different numbers where the path names several places
                yield tuple(number_at(scene, each.path) for each in ranges)

    def run_records(self, listing: Listing) -> Iterator[Record]:
        """Find runs, the newest first unless the listing says otherwise.

        Parameters
        ----------
        listing : Listing
            Filters are those of `summaries`.

        Returns
        -------
        iterator of Record
            As it was recorded.

        Raises
        ------
        StoreInputError
            If a filter or the field to sort by is wrong.
        """
        return self._catalog.runs(listing)

    def runs_page(
        self, where: Sequence[str] = (), after: str | None = None, limit: int = 100
    ) -> list[Record]:
        """Return a part of the runs that meet all filters, newest first, as they were recorded.

        Parameters
        ----------
        where : sequence of str
            Filters, as `summaries` takes them.
        after : str, optional
            Key of the last run of the part before; left out, the newest run is the first.
        limit : int
            How many runs at most.

        Returns
        -------
        list of Record

        Raises
        ------
        StoreInputError
            If a filter is malformed, its field is unknown, the value does not have its type, or there is no
            run ``after``.
        """
        if after is not None and not self.contains(after):
            raise StoreInputError(f"after: there is no run {after}")
        return self._catalog.runs_page(where, after, limit)

    def save_boundary(self, boundary: Boundary) -> None:
        """Insert a boundary, or replace the one of the same study, in one step.

        Parameters
        ----------
        boundary : Boundary

        Raises
        ------
        StoreError
            If it could not be written.
        """

        def put() -> None:
            with locked(self._lock):
                self._catalog.put_boundary(boundary)

        try:
            patiently(OSError, *UNUSABLE)(put)
        except (OSError, *UNUSABLE) as error:
            raise StoreError(
                f"boundary {boundary.name}: it could not be written ({reason(error)}); its runs are kept and "
                "the same command goes on"
            ) from error

    def boundaries(self, where: Sequence[str] = ()) -> list[Boundary]:
        """Return the boundaries that meet all filters; the latest change last.

        Parameters
        ----------
        where : sequence of str
            Filters, such as ``name=critical-hamaker``.

        Returns
        -------
        list of Boundary

        Raises
        ------
        StoreInputError
            If a filter is malformed, its field is unknown, or the value does not have its type.
        """
        listing = Listing(tuple(where), sort="updated")
        return list(readable(Boundary, "boundary", self._catalog.boundaries(listing)))

    def boundaries_named(self, name: str) -> list[Boundary]:
        """Return the boundaries of a name, or else those of its changed studies, or whose key begins so.

        Parameters
        ----------
        name : str
            Name of the study, with or without its changes, or the first characters of its key.

        Returns
        -------
        list of Boundary
            The latest change last.
        """
        return list(readable(Boundary, "boundary", self._catalog.boundaries_named(name)))

    def boundary_records(self, listing: Listing) -> Iterator[Record]:
        """Find boundaries, the latest change first unless the listing says otherwise.

        Parameters
        ----------
        listing : Listing
            Filters are those of `boundaries`.

        Returns
        -------
        iterator of Record
            As it was recorded.

        Raises
        ------
        StoreInputError
            If a filter or the field to sort by is wrong.
        """
        return self._catalog.boundaries(listing)

    def boundary(self, study_key: str) -> Boundary:
        """Return the boundary of a study.

        Parameters
        ----------
        study_key : str

        Returns
        -------
        Boundary

        Raises
        ------
        NotStored
            If there is no such boundary.
        """
        return validated(Boundary, "boundary", self.boundary_record(study_key))

    def boundary_record(self, study_key: str) -> Record:
        """Return the boundary of a study as it was recorded.

        Parameters
        ----------
        study_key : str

        Returns
        -------
        Record

        Raises
        ------
        NotStored
            If there is no such boundary.
        """
        record = self._catalog.boundary(study_key)
        if record is None:
            raise NotStored(f"boundary: there is no boundary {study_key} in {self.path}")
        return record

    def boundary_runs_page(self, study_key: str, after: str | None = None, limit: int = 100) -> list[Record]:
        """Return a part of the runs that a boundary rests on, by ascending key, as they were recorded.

        Parameters
        ----------
        study_key : str
        after : str, optional
            Key of the run before the first one of the part; left out, the part is the first.
        limit : int
            How many runs at most.

        Returns
        -------
        list of Record

        Raises
        ------
        NotStored
            If there is no boundary of this study.
        """
        keys = sorted({run for point in self.boundary(study_key).points for run in point.runs})
        following = keys if after is None else keys[bisect_right(keys, after) :]
        return list(islice(self._catalog.runs_of(following), limit))

    def boundaries_page(
        self, where: Sequence[str] = (), after: str | None = None, limit: int = 100
    ) -> list[Record]:
        """Return a part of the boundaries that meet all filters, by ascending key, as they were recorded.

        Parameters
        ----------
        where : sequence of str
            Filters, as `boundaries` takes them.
        after : str, optional
            Key of the last study of the part before.
        limit : int
            How many boundaries at most.

        Returns
        -------
        list of Record

        Raises
        ------
        StoreInputError
            If a filter is malformed, its field is unknown, or the value does not have its type.
        """
        return self._catalog.boundaries_page(where, after, limit)

    def save_branch(self, summary: BranchSummary, branch: SteadyBranch) -> None:
        """Keep a branch of steady states, unless the store has it.

        Parameters
        ----------
        summary : BranchSummary
        branch : SteadyBranch
        """
        self.branches.save(summary, branch, self._staging.directory())

    def copy_branch(self, key: str, source: Store) -> None:
        """Copy a branch of steady states from another store, unless this one has it.

        Parameters
        ----------
        key : str
            Of a branch of the other store.
        source : Store

        Raises
        ------
        StoreError
            If the branch is damaged.
        """
        self.branches.copy(key, source.branches, self._staging.directory())

    @cached_property
    def branches(self) -> BranchShelf:
        """The branches of steady states."""
        from ensemble.store.branch_shelf import BranchShelf

        return BranchShelf(self.path)

    @cached_property
    def boundary_grids(self) -> GridShelf[Boundary]:
        """The boundaries that are traced, as arrays."""
        from ensemble.store.boundary_arrays import BOUNDARY_ARRAYS
        from ensemble.store.grid_shelf import GridShelf

        key_of = attrgetter("study_key")
        return GridShelf(self.path, BOUNDARIES, "boundary", Boundary, key_of, BOUNDARY_ARRAYS)

    def save_boundary_arrays(self, boundary: Boundary) -> None:
        """Keep a boundary that is traced as arrays, too, instead of those of the same study.

        Parameters
        ----------
        boundary : Boundary

        Raises
        ------
        StoreError
            If they could not be written.
        """
        from ensemble.store.boundary_arrays import boundary_arrays

        self._save_grid(self.boundary_grids, boundary.study_key, boundary, boundary_arrays(boundary))

    @cached_property
    def map_grids(self) -> GridShelf[MapRecord]:
        """The maps."""
        from ensemble.search.map_record import MapRecord
        from ensemble.store.grid_shelf import GridShelf
        from ensemble.store.map_arrays import MAP_ARRAYS

        return GridShelf(self.path, MAPS, "map", MapRecord, attrgetter("key"), MAP_ARRAYS)

    def save_map(self, record: MapRecord) -> None:
        """Keep a map instead of an earlier one that answers the same question.

        Parameters
        ----------
        record : MapRecord

        Raises
        ------
        StoreError
            If it could not be written.
        """
        from ensemble.store.map_arrays import map_arrays

        self._save_grid(self.map_grids, record.key, record, map_arrays(record))

    def maps(self) -> list[MapRecord]:
        """Return all maps, the newest first.

        A damaged one is left out, with a warning that names it.

        Returns
        -------
        list of MapRecord
        """
        return sorted(self.map_grids.readable(), key=lambda record: record.updated, reverse=True)

    def map(self, key: str) -> MapRecord:
        """Return a map.

        Parameters
        ----------
        key : str

        Returns
        -------
        MapRecord

        Raises
        ------
        NotStored
            If there is no map of this key.
        StoreError
            If it is damaged.
        """
        if not self.map_grids.contains(key):
            raise NotStored(f"map: there is no map {key} in {self.path}")
        return self.map_grids.read(key)

    @property
    def shelves(self) -> tuple[Shelf[Any], ...]:
        """The answers that are arrays in a directory each."""
        return (self.branches, self.boundary_grids, self.map_grids)

    def set_answer_aside(self, shelf: Shelf[Any], key: str) -> Path:
        """Take the files of a branch, a boundary or a map out of the store, and keep them.

        Parameters
        ----------
        shelf : Shelf
            One of `shelves`.
        key : str
            Of an answer there.

        Returns
        -------
        Path
            Where its files are now.
        """
        with locked(self._lock):
            return self._recovery.set_aside(shelf.place(key))

    def lost_boundaries(self) -> list[str]:
        """Return the keys of the boundaries that are arrays and not in the catalog."""
        keys = self.boundary_grids.keys()
        return [key for key in keys if self._catalog.boundary(key) is None]

    def _save_grid(
        self, shelf: GridShelf[Any], key: str, answer: BaseModel, arrays: Mapping[str, NamedArray]
    ) -> None:
        attributes = answer.model_dump(mode="json")
        try:
            patiently(OSError)(shelf.save, key, attributes, arrays, self._staging.directory())
        except OSError as error:
            raise StoreError(
                f"{key}: its arrays could not be written ({reason(error)}); its runs are kept and the same "
                "command goes on from them"
            ) from error

    def check(self, on_progress: OnProgress | None = None, processes: int = 1) -> list[str]:
        """Verify every run, boundary, map and branch, and that directory and catalog name the same.

        Parameters
        ----------
        on_progress : callable, optional
            Takes the number of runs that are verified and the number of all.
        processes : int
            How many verify runs at once.

        Returns
        -------
        list of str
            Problems, one sentence each; empty if the store is whole.
        """
        from ensemble.store.verification import CheckNotes, run_problems

        problems = []
        try:
            different = self._recovery.differences()
            total = self._catalog.count_runs()
            boundaries = self._catalog.boundaries(Listing(sort="updated"))
            lost = [
                f"boundary {key}: it is in {BOUNDARIES}/ and not in the catalog"
                for key in self.lost_boundaries()
            ]
        except DatabaseError as error:
            return [f"the catalog cannot be read ({reason(error)})"]
        for record in boundaries:
            problems += _unreadable(record)
        notes = CheckNotes(self.path)
        unverified = (
            record for record in self._catalog.runs(Listing(sort="created")) if record.key not in notes.whole
        )
        found = run_problems(self.path, unverified, processes)
        try:
            for verified, (key, wrong) in enumerate(found, start=len(notes.whole) + 1):
                problems += wrong
                if not wrong:
                    notes.add(key)
                if on_progress is not None:
                    on_progress(verified, total)
        except BaseException:
            notes.write()
            raise
        notes.remove()
        shelved = [str(problem) for shelf in self.shelves for problem in shelf.problems().values()]
        return [*different, *lost, *problems, *shelved]


def _unreadable(record: Record) -> list[str]:
    """Say what keeps this version from reading a boundary; empty if nothing does."""
    try:
        validated(Boundary, "boundary", record)
    except OtherVersionError as error:
        return [str(error)]
    return []
