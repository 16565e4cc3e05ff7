"""What a run in progress has recorded: files beside its checkpoint, `checkpoints/KEY/WRITER/PART-NUMBER.h5`.

A file is a block of rows (`solver.analysis.record`).  It is written to the directory of its writer in
`staging/`, flushed and renamed, so that it is whole or not there.  A checkpoint counts the blocks before it;
later ones are written again by whoever goes on from it.  Each process has a directory of its own, with the
name of that in `staging/`: several may make the same run at once, and the blocks of one that lives are left
alone by all others.
"""

from __future__ import annotations

import os
import shutil
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache, partial
from itertools import accumulate
from pathlib import Path

import numpy as np

from ensemble.disk import flush, placing
from ensemble.errors import StoreError
from solver.analysis.record import FRAMES, Block, Sink, with_points
from solver.analysis.run import Array

_CACHED = 16  # blocks, while arrays are read one after the other


class RecordedBlocks(Sink):
    """The blocks of a run that this process makes.

    The last block of each part, and what the disk does not take, is kept in memory.

    Parameters
    ----------
    place : Path
        For the blocks of the run, of all processes.
    own_directory : callable
        Returns the directory in `staging/` where this process may write.

    Attributes
    ----------
    counts : dict of str to int
        How many blocks there are of each part of the record.
    rows : dict of str to int
        How many rows they have together.
    """

    memory = ("counts", "rows")

    def __init__(self, place: Path, own_directory: Callable[[], Path]) -> None:
        self.counts: dict[str, int] = {}
        self.rows: dict[str, int] = {}
        self._place = place
        self._own_directory = own_directory
        self._waiting: dict[tuple[str, int], Block] = {}
        self._has_files = False

    def take(self, part: str, block: Block) -> None:
        """Take the next rows, and write those before; see `Sink`.

        Parameters
        ----------
        part : str
        block : mapping of str to array
        """
        with suppress(OSError):  # then they wait until the disk takes them
            self._write([place for place in self._waiting if place[0] == part])
        number = self.counts.get(part, 0)
        self._waiting[part, number] = block
        self.counts[part] = number + 1
        self.rows[part] = self.rows.get(part, 0) + _length(block)

    def write(self) -> None:
        """Write all blocks that are not on disk.

        Raises
        ------
        OSError
            If the disk does not take them.
        """
        self._write(list(self._waiting))

    def _write(self, places: Sequence[tuple[str, int]]) -> None:
        from ensemble.store.plain_hdf5 import write_plain

        for part, number in places:
            path = self._made_directory() / _name(part, number)
            with placing(path, self._own_directory()) as unfinished:
                write_plain(unfinished, dict(self._waiting[part, number]), {})
            del self._waiting[part, number]
        if places:
            flush(self._directory)

    def take_over(self, writer: str, counts: Mapping[str, int]) -> None:
        """Make the blocks of a process that has ended, or of this one, the own ones.

        Parameters
        ----------
        writer : str
            Name of the directory of that process.
        counts : mapping of str to int
            How many blocks there are of each part.

        Raises
        ------
        StoreError
            If any is missing or damaged, or the disk does not take them.
        """
        source = self._place / writer
        try:
            for part, count in counts.items():
                for number in range(count):
                    read_block(source, part, number)
                    path = source / _name(part, number)
                    if source != self._directory:
                        _linked(path, self._made_directory() / path.name)
        except OSError as error:
            raise StoreError(f"what it has recorded cannot be taken over ({error.strerror})") from error
        self._has_files |= source == self._directory

    def parts(self, points: int | None) -> dict[str, dict[str, RecordedArray]]:
        """Return all that is recorded.

        Parameters
        ----------
        points : int or None
            On each vesicle at the end.

        Returns
        -------
        dict of str to dict of str to RecordedArray
            By the part of the record, and by name.
        """

        def read(part: str, number: int) -> Block:
            block = self._block(part, number)
            return with_points(block, points) if part == FRAMES and points else block

        return {part: recorded_arrays(count, partial(read, part)) for part, count in self.counts.items()}

    def remove(self) -> None:
        """Remove the files of this process."""
        if self._has_files:
            shutil.rmtree(self._directory, ignore_errors=True)
            with suppress(OSError):  # of other processes
                self._place.rmdir()

    def _block(self, part: str, number: int) -> Block:
        waiting = self._waiting.get((part, number))
        if waiting is not None:
            return waiting
        return read_block(self._directory, part, number)

    @property
    def _directory(self) -> Path:
        return self._place / self._own_directory().name

    def _made_directory(self) -> Path:
        self._directory.mkdir(parents=True, exist_ok=True)
        self._has_files = True
        return self._directory


class RecordedArray:
    """An array of a record, whose rows are read when they are asked for.

    Parameters
    ----------
    name : str
    ends : sequence of int
        The rows up to the end of each block.
    read : callable
        From the number of a block to the block.

    Attributes
    ----------
    shape : tuple of int
    dtype : numpy.dtype
    """

    def __init__(self, name: str, ends: Sequence[int], read: Callable[[int], Block]) -> None:
        self._name, self._ends, self._read = name, ends, read
        first = read(0)[name]
        self.shape: tuple[int, ...] = (ends[-1], *first.shape[1:])
        self.dtype = first.dtype

    def __getitem__(self, rows: slice) -> Array:
        """Read successive rows.

        Parameters
        ----------
        rows : slice
            Without a step.

        Returns
        -------
        (rows, ...)
        """
        begin, end, _ = rows.indices(self.shape[0])
        found = []
        for number in range(bisect_right(self._ends, begin), len(self._ends)):
            before = self._ends[number - 1] if number else 0
            if before >= end:
                break
            found.append(self._read(number)[self._name][max(begin - before, 0) : end - before])
        return np.concatenate(found) if found else np.empty((0, *self.shape[1:]))


def recorded_arrays(count: int, read: Callable[[int], Block]) -> dict[str, RecordedArray]:
    """Return the arrays of a part of a record.

    Parameters
    ----------
    count : int
        How many blocks there are, at least one.
    read : callable
        From the number of a block to the block.

    Returns
    -------
    dict of str to RecordedArray
        By name.
    """
    read = lru_cache(_CACHED)(read)
    ends = list(accumulate(_length(read(number)) for number in range(count)))
    return {name: RecordedArray(name, ends, read) for name in read(0)}


def read_block(directory: Path, part: str, number: int) -> Block:
    """Read a block.

    Parameters
    ----------
    directory : Path
        Of its writer.
    part : str
    number : int

    Returns
    -------
    dict of str to array

    Raises
    ------
    StoreError
        If it is missing or damaged; the message says so without the name of the run.
    """
    from ensemble.store.plain_hdf5 import UnreadableFileError, read_plain

    try:
        block: Block = read_plain(directory / _name(part, number))
    except UnreadableFileError as error:
        raise StoreError(f"what it has recorded is damaged ({_name(part, number)}: {error})") from error
    return block


def _length(block: Block) -> int:
    return len(next(iter(block.values())))


def _name(part: str, number: int) -> str:
    return f"{part}-{number:06d}.h5"


def _linked(source: Path, target: Path) -> None:
    """Give a file that never changes another name, or copy it where the file system has no links."""
    target.unlink(missing_ok=True)
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)
        flush(target)
