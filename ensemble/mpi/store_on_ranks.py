"""One store on all ranks: the first rank opens it, the others only write runs for it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from ensemble.config.checkpoint_interval import checkpoint_seconds
from ensemble.errors import refusing
from ensemble.mpi.world import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from ensemble.store import RunStaging, Store

    StoreOnRank = Store | RunStaging  # the store on the first rank, where runs are staged on the others


def whole_store(store: StoreOnRank) -> Store:
    """Return the store that the first rank has.

    Parameters
    ----------
    store : Store or RunStaging
        From `store_on_ranks`, on the first rank.

    Returns
    -------
    Store
    """
    from ensemble.store import Store

    assert isinstance(store, Store), "only the first rank has the whole store"
    return store


@contextmanager
def store_on_ranks(
    communicator: Intracomm | None, path: Path, report: str | None = None
) -> Iterator[StoreOnRank]:
    """Open a store to write to, on all ranks of a communicator.

    Only the first rank has a connection to the catalog: SQLite files on a network file system must be used
    from one node, and servers limit their connections.  Collective.

    Parameters
    ----------
    communicator : Intracomm or None
        All ranks; None if this process is alone.
    path : Path
        As the first rank understands it.
    report : str, optional
        Name of the report that runs are made for.

    Yields
    ------
    Store or RunStaging
        The store on the first rank, and where runs are staged for it on the others.

    Raises
    ------
    BadInput
        On every rank, if the first one cannot open the store to write, or the interval of checkpoints is no
        number that is allowed.
    """
    from ensemble.store import RunStaging, Store

    with ExitStack() as stack:
        store: Store | None = None

        def open_store() -> Path:
            nonlocal store
            checkpoint_seconds()  # refused before there is a store
            with refusing():
                store = stack.enter_context(Store.open(path, report))
            return store.path

        resolved = on_root(communicator, open_store)
        yield store if store is not None else stack.enter_context(RunStaging(resolved, report))
