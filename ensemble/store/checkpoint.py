"""The checkpoint of a run in progress, from which it goes on to the bits that it would have had.

It is one file, `checkpoints/KEY.h5` in the store, that holds what `solver.Simulation.saved` returns.  It is
written to the directory of its writer in `staging/`, flushed and renamed, so that it is whole or the one
before.  It is removed when its run is committed.  A run that is canceled because nobody needs it removes its
own one, and leaves one that it has gone on from.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from ensemble.config.run_key import run_key
from ensemble.disk import flush
from ensemble.errors import StoreError
from solver.revision import RESULTS_REVISION

if TYPE_CHECKING:
    from solver.memory import Saved
    from solver.scene import Scene

CHECKPOINTS = "checkpoints"
SUFFIX = ".h5"


class Checkpoint:
    """The place of the checkpoint of one run; there may be none yet.

    Parameters
    ----------
    store : Path
        Directory of the store.
    scene : Scene
        Of the run.
    own_directory : callable
        Returns the directory in the store where this process may write.
    """

    def __init__(self, store: Path, scene: Scene, own_directory: Callable[[], Path]) -> None:
        self.key = run_key(scene)
        self._store = store
        self._scene = scene
        self._own_directory = own_directory

    def write(self, saved: Saved) -> None:
        """Put a state in the place of the one before.

        Parameters
        ----------
        saved : dict
            As `Simulation.saved` returns it.

        Raises
        ------
        OSError
            If the disk does not take it; then the one before stays.
        """
        from ensemble.store.plain_hdf5 import write_plain

        path = checkpoint_path(self._store, self.key)
        path.parent.mkdir(exist_ok=True)
        unfinished = self._own_directory() / path.name
        try:
            write_plain(unfinished, saved, self._attributes())
            flush(unfinished)
            unfinished.replace(path)
        finally:
            unfinished.unlink(missing_ok=True)  # its space may be what lacks
        flush(path.parent)

    def read(self) -> Saved | None:
        """Read the state.

        Returns
        -------
        dict or None
            As `Simulation.restored` takes it; None if there is none.

        Raises
        ------
        StoreError
            If there is a file from which the run cannot go on; the message says why.  One of an earlier
            `RESULTS_REVISION` is removed.
        """
        from ensemble.store.plain_hdf5 import UnreadableFileError, read_attributes, read_plain

        path = checkpoint_path(self._store, self.key)
        if not path.exists():
            self._remove_earlier_ones()
            return None
        try:
            attributes = read_attributes(path)
            for name, expected in self._attributes().items():
                if attributes.get(name) != expected:
                    raise StoreError(f"it has the {name} {attributes.get(name)}, and not {expected}")
            saved: Saved = read_plain(path)
        except UnreadableFileError as error:
            raise StoreError(f"it is damaged ({error})") from error
        return saved

    def remove(self) -> None:
        """Remove it."""
        remove_checkpoint(self._store, self.key)

    def _attributes(self) -> dict[str, str | int]:
        return {"key": self.key, "results_revision": RESULTS_REVISION}

    def _remove_earlier_ones(self) -> None:
        """Remove what no later run can go on from, and say so."""
        removed = []
        for revision in range(1, RESULTS_REVISION):
            key = run_key(self._scene, revision)
            if checkpoint_path(self._store, key).exists():
                remove_checkpoint(self._store, key)
                removed.append(revision)
        if removed:
            raise StoreError(
                f"it has the results_revision {removed[-1]}, and not {RESULTS_REVISION}; it is removed"
            )


def checkpoint_path(store: Path, key: str) -> Path:
    """Return where the checkpoint of a run is, if there is one.

    Parameters
    ----------
    store : Path
        Directory of the store.
    key : str
        Of the run.

    Returns
    -------
    Path
    """
    return store / CHECKPOINTS / f"{key}{SUFFIX}"


def remove_checkpoint(store: Path, key: str) -> None:
    """Remove the checkpoint of a run, if there is one.

    Parameters
    ----------
    store : Path
        Directory of the store.
    key : str
        Of the run.
    """
    # One that stays for whatever reason is removed when the store is opened next.
    with suppress(OSError):
        checkpoint_path(store, key).unlink()


def checkpointed_keys(store: Path) -> Iterator[str]:
    """Find the runs that have a checkpoint.

    Parameters
    ----------
    store : Path
        Directory of the store.

    Yields
    ------
    str
        Key of a run.
    """
    for path in (store / CHECKPOINTS).glob(f"*{SUFFIX}"):
        yield path.stem
