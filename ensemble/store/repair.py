"""Repairs a store: rebuilds a lost or damaged catalog and sets aside whatever is damaged."""

from __future__ import annotations

from contextlib import closing, suppress
from pathlib import Path

from sqlalchemy.exc import DatabaseError

from ensemble.disk import locked
from ensemble.errors import OtherVersionError, StoreInputError
from ensemble.store.catalog import Catalog
from ensemble.store.listing import Listing
from ensemble.store.recovery import Recovery
from ensemble.store.sql_database import CATALOG, Place, is_file
from ensemble.store.staging import RUNS, STORE_LOCK
from ensemble.store.store import Store
from ensemble.store.store_directory import refused, require_catalog, require_writable
from ensemble.store.verification import OnProgress, run_problems
from ensemble.store.writers import STAGING


def repair(path: Path, on_progress: OnProgress | None = None, processes: int = 1) -> list[str]:
    """Rebuild a lost or damaged catalog, adopt whole runs, and set damaged runs and other answers aside.

    Nothing is deleted: what cannot be used is moved to `lost+found/`.  Boundaries that were traced to their
    end come back from their arrays.  Others are only in the catalog; their studies trace them again without
    a simulation.

    Parameters
    ----------
    path : Path
        The directory.
    on_progress : callable, optional
        Takes the number of runs that are verified and the number of all.
    processes : int
        How many verify runs at once.

    Returns
    -------
    list of str
        What was done, one clause each.

    Raises
    ------
    StoreInputError
        If there is no store at the path, or it cannot be written to.
    """
    if not (path / RUNS).is_dir():
        raise StoreInputError(f"store: there is no store at {path}")
    done = []
    with refused(path):
        require_writable(path)
        (path / STAGING).mkdir(exist_ok=True)
        if is_file(Place.of(path).url) and not _is_usable(path):
            done += _new_catalog(path)
        store = Store(path)
    with store, refused(path):
        done += store.recover()
        total, damaged = store.count_runs(), {}
        found = run_problems(store.path, store.run_records(Listing(sort="created")), processes)
        for verified, (key, problems) in enumerate(found, start=1):
            if problems:
                damaged[key] = problems[0]
            elif not (store.path / RUNS / key).is_dir():
                damaged[key] = f"run {key}: its directory is missing"
            if on_progress is not None:
                on_progress(verified, total)
        done += [_set_aside(store, key, problem) for key, problem in damaged.items()]
        done += [*_repaired_answers(store), *_restored_boundaries(store)]
    return done


def _set_aside(store: Store, key: str, problem: str) -> str:
    """Set a damaged run aside, unless it is only that this version cannot read its record."""
    try:
        store.summary(key)
    except OtherVersionError as error:
        return f"{error}; left as it is"
    store.set_aside(key)
    return f"{problem}; set aside, so that it can be made again"


def _repaired_answers(store: Store) -> list[str]:
    """Set aside the files of damaged branches, boundaries and maps."""
    done = []
    for shelf in store.shelves:
        for key, problem in shelf.problems().items():
            if isinstance(problem, OtherVersionError):
                done.append(f"{problem}; left as it is")
            else:
                store.set_answer_aside(shelf, key)
                done.append(f"{problem}; set aside, so that it can be made again")
    return done


def _restored_boundaries(store: Store) -> list[str]:
    """Enter the boundaries into the catalog that only their arrays have."""
    restored = 0
    for key in store.lost_boundaries():
        with suppress(OtherVersionError):  # it has been named
            store.save_boundary(store.boundary_grids.read(key))
            restored += 1
    return [f"restored {restored} boundaries that were not in the catalog"] if restored else []


def _new_catalog(path: Path) -> list[str]:
    """Put an empty catalog in the place of one that is lost or damaged, which is kept."""
    done = []
    with locked(path / STORE_LOCK):
        catalog = Catalog(Place.of(path))
        recovery = Recovery(path, catalog)
        for suffix in ("", "-wal", "-shm", "-journal"):
            file = path / f"{CATALOG}{suffix}"
            if file.exists():
                done.append(f"{file.name} is damaged; moved to {recovery.set_aside(file)}")
        (path / CATALOG).touch()
        with closing(catalog):
            catalog.create()
    return [*done, f"{CATALOG} is made again"]


def _is_usable(path: Path) -> bool:
    """Tell whether the catalog in a file is there and whole."""
    try:
        require_catalog(path)
        with closing(Catalog(Place.of(path))) as catalog:
            catalog.require_whole()
    except (OSError, DatabaseError):
        return False
    return True
