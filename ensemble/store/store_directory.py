"""The directory of a store: what one looks like, how it is made, and why it cannot be opened."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from sqlalchemy.exc import DatabaseError

from ensemble.disk import flush, locked, require_space
from ensemble.errors import FULL, StoreError, StoreInputError
from ensemble.store.catalog import Catalog
from ensemble.store.sql_database import CATALOG, PLACE, UNUSABLE, Place, is_file, reason
from ensemble.store.staging import RUNS, STORE_LOCK
from ensemble.store.writers import STAGING


def exists(path: Path) -> bool:
    """Tell whether a path is a store.

    Parameters
    ----------
    path : Path

    Returns
    -------
    bool
    """
    # An empty `staging` may be missing from a copy.
    return (path / RUNS).is_dir() and any((path / name).exists() for name in (STAGING, CATALOG, PLACE))


def create(path: Path) -> None:
    """Make a new store.

    Parameters
    ----------
    path : Path
        A new directory, or an empty one.

    Raises
    ------
    StoreInputError
        If it is something else or cannot be made.
    """
    if path.exists() and not path.is_dir():
        raise StoreInputError(f"store: {path} is a file; give a directory")
    with refused(path):
        path.mkdir(parents=True, exist_ok=True)
        # Hidden files (of a desktop, say) do no harm.
        foreign = {entry.name for entry in path.iterdir() if not entry.name.startswith(".")} - {STORE_LOCK}
        if foreign and not foreign & {CATALOG, PLACE}:
            raise StoreInputError(
                f"store: {path} is not a store and already holds {min(foreign)}; give a new directory"
            )
        with locked(path / STORE_LOCK):
            place = Place.choose(path)
            if is_file(place.url):
                (path / CATALOG).touch()  # SQLite itself would not honor the umask
            with closing(Catalog(place)) as catalog:
                catalog.create()
            place.keep(path)
            for directory in (RUNS, STAGING):
                (path / directory).mkdir(exist_ok=True)
            flush(path)


def require_writable(path: Path) -> None:
    """Raise an error unless runs could be written, before any is computed.

    Parameters
    ----------
    path : Path
        Of the store.

    Raises
    ------
    OSError
    """
    for directory in (path, path / RUNS, path / STAGING):
        if directory.exists() and not os.access(directory, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, f"no permission to write to {directory}")
    require_space(path)


def require_catalog(path: Path) -> None:
    """Raise an error where the file of the catalog is missing, before a new one is made in its place.

    Parameters
    ----------
    path : Path
        Of the store.

    Raises
    ------
    OSError
    """
    if is_file(Place.of(path).url) and not (path / CATALOG).exists():
        raise FileNotFoundError(errno.ENOENT, f"{CATALOG} is missing")


@contextmanager
def refused(path: Path) -> Iterator[None]:
    """Say why a store cannot be opened.

    Parameters
    ----------
    path : Path
        Of the store.

    Yields
    ------
    None

    Raises
    ------
    StoreInputError
        Instead of an error of the disk or the database.
    StoreError
        If the disk is full.
    """
    try:
        yield
    except (OSError, *UNUSABLE) as error:
        text = getattr(error, "strerror", None) or reason(error)
        if getattr(error, "errno", None) in FULL:  # nothing is wrong with what was asked
            raise StoreError(f"store: {path} cannot be written to ({text})") from error
        lost = isinstance(error, FileNotFoundError | DatabaseError) and exists(path)
        hint = (
            f"; `ensemble check --repair --store {path}` rebuilds a lost or damaged catalog" if lost else ""
        )
        raise StoreInputError(f"store: {path} cannot be opened ({text}){hint}") from error
