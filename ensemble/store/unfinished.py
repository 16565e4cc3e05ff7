"""Runs that are not done, as their checkpoints and what they have recorded show them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from pydantic import ValidationError

from ensemble.errors import StoreError, StoreInputError, UnfinishedRunError
from ensemble.store.checkpoint import CHECKPOINTS, checkpoint_path, checkpointed_keys, read_checkpoint
from ensemble.store.writers import STAGING, lives
from solver.scene import Scene

if TYPE_CHECKING:
    from ensemble.store.recorded_blocks import RecordedArray
    from solver.analysis.record import Block
    from solver.analysis.run import Run
    from solver.memory import Saved


@dataclass(frozen=True)
class UnfinishedRun:
    """A run that has a checkpoint, as it was then.

    Attributes
    ----------
    key : str
    checkpoint : Path
    scene : Scene
    written : datetime
        When the checkpoint was written.
    time : float or None
        That it has reached; None while its start relaxes.
    in_progress : bool
        Whether the process that wrote it lives.
    saved : dict
        What `solver.Simulation.saved` returned.
    place : Path
        Of what that process has recorded of the run.
    counts : dict of str to int
        How many blocks the checkpoint counts of each part of the record.
    rows : dict of str to int
        How many rows they have together.
    """

    key: str
    checkpoint: Path
    scene: Scene
    written: datetime
    time: float | None
    in_progress: bool
    saved: Saved
    place: Path
    counts: dict[str, int]
    rows: dict[str, int]

    @classmethod
    def read(cls, store: Path, key: str) -> Self:
        """Read the checkpoint of a run.

        Parameters
        ----------
        store : Path
            Directory of the store.
        key : str
            Of the run.

        Returns
        -------
        UnfinishedRun

        Raises
        ------
        UnfinishedRunError
            If there is none from which the run can go on.
        """
        from solver.simulation.run_so_far import time_so_far

        path = checkpoint_path(store, key)
        try:
            written = _written(path)  # before it is read, as it may be replaced at any time
            content = read_checkpoint(store, key)
            record = content["record"]
            return cls(
                key=key,
                checkpoint=path,
                scene=Scene.model_validate_json(content["scene"]),
                written=written,
                time=time_so_far(content["simulation"]),
                in_progress=lives(store / STAGING / record["writer"]),
                saved=content["simulation"],
                place=store / CHECKPOINTS / key / record["writer"],
                counts=record["counts"],
                rows=record["rows"],
            )
        except OSError as error:
            raise _useless(key, error.strerror or "it cannot be read") from error
        except StoreError as error:
            raise _useless(key, str(error)) from error
        except (LookupError, TypeError, ValidationError) as error:
            raise _useless(key, "another version wrote it") from error

    @property
    def status(self) -> str:
        """Whether a process goes on with it, in words."""
        return "in progress" if self.in_progress else "interrupted"

    @property
    def progress(self) -> str:
        """How far it has come, in words."""
        if self.time is None:
            return "while its start relaxes"
        return f"at time {self.time:.6g} of {self.scene.horizon:g} at the latest"

    def run(self) -> Run | None:
        """Return what has been computed and recorded.

        Returns
        -------
        Run or None
            Undecided, without answers.  None while the start relaxes.

        Raises
        ------
        UnfinishedRunError
            If what was recorded cannot be read: it is damaged, or the run goes on or ends meanwhile.
        """
        from solver.analysis.record import InMemory
        from solver.simulation.run_so_far import run_so_far

        memory = InMemory()
        for part, block in self.blocks():
            memory.take(part, block)
        return run_so_far(self.scene, self.saved, memory)

    def blocks(self) -> Iterator[tuple[str, Block]]:
        """Read all blocks that the checkpoint counts.

        Yields
        ------
        str
            The part of the record.
        dict of str to array
            The block.

        Raises
        ------
        UnfinishedRunError
            If they cannot be read; see `run`.
        """
        for part, count in self.counts.items():
            for number in range(count):
                yield part, self._block(part, number)

    def _block(self, part: str, number: int) -> Block:
        from ensemble.store.recorded_blocks import read_block

        try:
            return read_block(self.place, part, number)
        except StoreError as error:
            # A process removes its blocks when it has staged the run, some time before that is committed.
            if self.in_progress or self._is_replaced():
                raise UnfinishedRunError(
                    f"run {self.key}: it goes on or ends, and its record cannot be read now; try again"
                ) from error
            raise _useless(self.key, str(error)) from error

    def _is_replaced(self) -> bool:
        try:
            return _written(self.checkpoint) != self.written
        except FileNotFoundError:
            return True

    def series(self) -> dict[str, RecordedArray]:
        """Return the diagnostics that have been recorded, to read some of their rows.

        Returns
        -------
        dict of str to RecordedArray
            By name; empty while the start relaxes.

        Raises
        ------
        UnfinishedRunError
            If they cannot be read; see `run`.
        """
        from ensemble.store.recorded_blocks import recorded_arrays
        from solver.analysis.record import SERIES
        from solver.simulation.run_so_far import open_blocks

        last, written = open_blocks(self.saved).get(SERIES), self.counts.get(SERIES, 0)
        count = written + (last is not None)

        def read(number: int) -> Block:
            return last if last is not None and number == written else self._block(SERIES, number)

        return recorded_arrays(count, read) if count else {}

    def json_document(self) -> dict[str, Any]:
        """Return how far the run has come, its last diagnostics, and its scene.

        Returns
        -------
        dict
            JSON data.
        """
        from solver.analysis.record import FRAMES, SERIES
        from solver.simulation.run_so_far import open_blocks, sample_so_far

        last = open_blocks(self.saved)

        def rows(part: str) -> int:
            return self.rows.get(part, 0) + (len(last[part]["time"]) if part in last else 0)

        return {
            "run_key": self.key,
            "status": self.status,
            "written": self.written.isoformat(timespec="seconds"),
            "time": self.time,
            "horizon": self.scene.horizon,
            "wall_seconds": self.saved["wall_seconds"],
            "samples": rows(SERIES),
            "frames": rows(FRAMES),
            "last": sample_so_far(self.saved),
            "scene": self.scene.model_dump(mode="json", exclude_none=True),
        }


def unfinished_run(store: Path, beginning: str) -> UnfinishedRun | None:
    """Read the checkpoint of the only run whose key begins so.

    Parameters
    ----------
    store : Path
        Directory of the store.
    beginning : str
        The first characters of the key, or all of it.

    Returns
    -------
    UnfinishedRun or None
        None if there is no such run.

    Raises
    ------
    StoreInputError
        If there are several.
    UnfinishedRunError
        If the run cannot go on from its checkpoint.
    """
    keys = sorted(key for key in checkpointed_keys(store) if beginning and key.startswith(beginning))
    if len(keys) > 1:
        raise StoreInputError(f"run: {beginning} is the beginning of several keys: {', '.join(keys[:5])}")
    return _read_if_there(store, keys[0]) if keys else None


def interrupted_runs(store: Path) -> Iterator[str]:
    """Name the runs that have a checkpoint, and that nobody goes on with at present.

    Parameters
    ----------
    store : Path
        Directory of the store.

    Yields
    ------
    str
        One sentence for each.
    """
    for key in sorted(checkpointed_keys(store)):
        try:
            unfinished = _read_if_there(store, key)
            if unfinished is None or unfinished.in_progress:
                continue
            for _ in unfinished.blocks():
                pass
        except UnfinishedRunError as error:
            yield str(error)
        else:
            written = f"{unfinished.written:%Y-%m-%d %H:%M} UTC"
            yield (
                f"run {key}: interrupted {unfinished.progress}, {written}; the next command that needs it "
                "goes on from there"
            )


def _read_if_there(store: Path, key: str) -> UnfinishedRun | None:
    """Read a checkpoint; None if it is gone, because its run has just been finished or dropped."""
    try:
        return UnfinishedRun.read(store, key)
    except UnfinishedRunError:
        if checkpoint_path(store, key).exists():
            raise
        return None


def _written(checkpoint: Path) -> datetime:
    return datetime.fromtimestamp(checkpoint.stat().st_mtime, UTC)


def _useless(key: str, reason: str) -> UnfinishedRunError:
    return UnfinishedRunError(
        f"run {key}: its checkpoint cannot be used: {reason}; the next command that needs the run begins anew"
    )
