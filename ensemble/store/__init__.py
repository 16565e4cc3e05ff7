"""The store: a directory of runs (zarr v3 groups) and a catalog of what is committed (SQLite,
or a PostgreSQL server).

A run is written to `staging/`, flushed to disk, renamed into `runs/` and then entered in the catalog.  Only
that last step makes it exist, so a process may die at any moment: what it acknowledged is there, whole, and
what it left behind is swept.  One lock file, held only for moments, keeps sweeping apart from committing.
"""

from ensemble.store.catalog import Record
from ensemble.store.store import Staged, Store
from ensemble.store.store_errors import NotStored, StoreError, StoreInputError

__all__ = ["NotStored", "Record", "Staged", "Store", "StoreError", "StoreInputError"]
