"""The checkpoint of a run in progress, from which it goes on to the bits that it would have had.

It is one file, `checkpoints/KEY.h5` in the store, that holds the scene and what `solver.Simulation.saved`
returns, and beside it the blocks of what the run has recorded (`recorded_blocks`).  It is written to the
directory of its writer in `staging/`, flushed and renamed, so that it is whole or the one before.  It is
removed when its run is committed.  A run that is canceled because nobody needs it removes its own one, and
leaves one that it has gone on from.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ensemble.config.run_key import run_key
from ensemble.disk import flush, placing
from ensemble.errors import StoreError
from ensemble.store.writers import STAGING, is_own_directory, is_own_name, lives
from solver.revision import RESULTS_REVISION

if TYPE_CHECKING:
    from ensemble.store.recorded_blocks import RecordedBlocks
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

    Attributes
    ----------
    key : str
        Of the run.
    """

    def __init__(self, store: Path, scene: Scene, own_directory: Callable[[], Path]) -> None:
        self.key = run_key(scene)
        self._store = store
        self._scene = scene
        self._own_directory = own_directory

    @cached_property
    def record(self) -> RecordedBlocks:
        """What takes what the run records."""
        from ensemble.store.recorded_blocks import RecordedBlocks

        return RecordedBlocks(self._store / CHECKPOINTS / self.key, self._own_directory)

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
        self.record.write()
        writer = self._own_directory().name
        content = {
            "scene": self._scene.model_dump_json(),
            "simulation": saved,
            "record": {"writer": writer, "counts": self.record.counts, "rows": self.record.rows},
        }
        with placing(path, self._own_directory()) as unfinished:
            write_plain(unfinished, content, _attributes(self.key) | {"writer": writer})
        flush(path.parent)
        sweep_blocks(self._store, self.key)

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
        if not checkpoint_path(self._store, self.key).exists():
            self._remove_earlier_ones()
            return None
        content = read_checkpoint(self._store, self.key)
        self.record.take_over(content["record"]["writer"], content["record"]["counts"])
        saved: Saved = content["simulation"]
        return saved

    def remove(self) -> None:
        """Remove it, and what this process has recorded."""
        self.record.remove()
        remove_checkpoint(self._store, self.key)

    def leave(self) -> None:
        """Leave it to others, and remove what this process has recorded unless it counts that."""
        if _writer_of_checkpoint(self._store, self.key) != self._own_directory().name:
            self.record.remove()

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


def read_checkpoint(store: Path, key: str) -> dict[str, Any]:
    """Read what the checkpoint of a run holds.

    Parameters
    ----------
    store : Path
        Directory of the store.
    key : str
        Of the run.

    Returns
    -------
    dict
        ``scene``, ``simulation`` and ``record``, as `Checkpoint.write` wrote them.

    Raises
    ------
    StoreError
        If the run cannot go on from it; the message says why, without the name of the run.
    """
    from ensemble.store.plain_hdf5 import UnreadableFileError, read_attributes, read_plain

    path = checkpoint_path(store, key)
    try:
        attributes = read_attributes(path)
        for name, expected in _attributes(key).items():
            if attributes.get(name) != expected:
                raise StoreError(f"it has the {name} {attributes.get(name)}, and not {expected}")
        content = read_plain(path)
    except UnreadableFileError as error:
        raise StoreError(f"it is damaged ({error})") from error
    if not isinstance(content, dict) or "record" not in content:
        raise StoreError("an earlier version wrote it")
    return content


def remove_checkpoint(store: Path, key: str) -> None:
    """Remove the checkpoint of a run, if there is one, and what processes that have ended recorded of it.

    Parameters
    ----------
    store : Path
        Directory of the store.
    key : str
        Of the run.
    """
    # One that stays for whatever reason is removed when the store is opened next.
    with suppress(OSError):
        checkpoint_path(store, key).unlink(missing_ok=True)
    sweep_blocks(store, key)


def sweep_blocks(store: Path, key: str) -> None:
    """Remove what processes that have ended recorded of a run, but for what its checkpoint counts.

    Parameters
    ----------
    store : Path
        Directory of the store.
    key : str
        Of the run.
    """
    place = store / CHECKPOINTS / key
    with suppress(OSError):  # what stays for whatever reason is removed when the store is opened next
        ended = [
            directory
            for directory in place.iterdir()
            if is_own_directory(directory) and not lives(store / STAGING / directory.name)
        ]
        # A process that has ended writes no checkpoint any more: so this is looked at after that.
        counted = _writer_of_checkpoint(store, key) if ended else None
        for directory in ended:
            if directory.name != counted:
                shutil.rmtree(directory)
        place.rmdir()


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
        if is_own_name(path.stem):
            yield path.stem


def unfinished_keys(store: Path) -> set[str]:
    """Find the runs that have a checkpoint, or of which something is recorded.

    Parameters
    ----------
    store : Path
        Directory of the store.

    Returns
    -------
    set of str
        Keys of runs.
    """
    recorded = (path.name for path in (store / CHECKPOINTS).glob("*") if is_own_directory(path))
    return {*checkpointed_keys(store), *recorded}


def _attributes(key: str) -> dict[str, str | int]:
    """Return what the file of a checkpoint says about itself, but for its writer."""
    return {"key": key, "results_revision": RESULTS_REVISION}


def _writer_of_checkpoint(store: Path, key: str) -> str | None:
    """Return the name of the writer whose blocks a checkpoint counts; None if there is none that says it."""
    from ensemble.store.plain_hdf5 import UnreadableFileError, read_attributes

    try:
        writer = read_attributes(checkpoint_path(store, key)).get("writer")
    except UnreadableFileError:
        return None
    return writer if isinstance(writer, str) else None
