"""The store: a directory of runs and a catalog of what is committed.

Runs are zarr v3 groups, the catalog is an SQLite file or on a PostgreSQL server.
A run is written to `staging/`, flushed to disk, renamed into `runs/` and then entered in the catalog.  Only
that last step makes it exist, so a process may die at any moment: what it acknowledged is there, whole.  What
it left behind is adopted if it is a whole run (`recovery`).  One lock file, held only for moments, keeps
recovery apart from committing.

Names are imported on first use: a command that keeps nothing does not load the database library.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ensemble.errors import NotStored, StoreError, StoreInputError

if TYPE_CHECKING:
    from ensemble.store.catalog_tables import Record
    from ensemble.store.staging import RunStaging, Staged
    from ensemble.store.store import Store

__all__ = ["NotStored", "Record", "RunStaging", "Staged", "Store", "StoreError", "StoreInputError"]

_MODULES = {"Record": "catalog_tables", "RunStaging": "staging", "Staged": "staging", "Store": "store"}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
