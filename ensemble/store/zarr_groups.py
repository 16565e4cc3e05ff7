"""Named arrays with attributes on disk: zarr v3 groups that xarray opens as one data set.

A group is one file, ``zarr.zip`` in a directory of its own: a zip archive, uncompressed, of what zarr would
write as files, metadata and compressed chunks.  So a store of many runs needs few inodes and a run is flushed
to disk at once, and still a reader seeks and reads only the chunks that it asks for.

Earlier versions wrote the same content as files of the directory itself.  Those are read as they are.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
import zarr
from zarr.codecs import ZstdCodec
from zarr.storage import LocalStore, ZipStore

from ensemble.errors import StoreError
from ensemble.store.run_record import NamedArray, Rows
from ensemble.store.written_arrays import DAMAGE, read_written
from solver.analysis.run import Array

ARCHIVE = "zarr.zip"
CHUNK_BYTES = 1 << 20


def _chunks(values: Rows) -> tuple[int, ...]:
    """Chunk shape of at most about `CHUNK_BYTES`, cut along the first dimension (time) only."""
    bytes_each = max(values.dtype.itemsize * math.prod(values.shape[1:]), 1)
    rows = min(max(CHUNK_BYTES // bytes_each, 1), values.shape[0])
    return tuple(max(length, 1) for length in (rows, *values.shape[1:]))


def write_group(directory: Path, attributes: dict[str, Any], arrays: Mapping[str, NamedArray]) -> None:
    """Write a group, chunk by chunk.

    Parameters
    ----------
    directory : Path
        Made if it is not there.
    attributes : dict
        JSON data.
    arrays : mapping of str to NamedArray
        The arrays by name.
    """
    directory.mkdir(parents=True, exist_ok=True)
    with closing(ZipStore(directory / ARCHIVE, mode="w")) as store:
        group = zarr.create_group(store, zarr_format=3, attributes=attributes)
        for name, array in arrays.items():
            _write_array(group, name, array)


def _write_array(group: zarr.Group, name: str, array: NamedArray) -> None:
    values, chunks = array.values, _chunks(array.values)
    stored = group.create_array(
        name,
        shape=values.shape,
        dtype=values.dtype,
        chunks=chunks,
        # The checksum turns a flipped bit into an error instead of a different number.
        compressors=ZstdCodec(level=3, checksum=True),
        dimension_names=array.dimensions,
        attributes=array.attributes,
        fill_value=float("nan"),
        # Every chunk is written, so a missing one is a loss and never an array of fill values.
        config={"write_empty_chunks": True},
    )
    for begin in range(0, values.shape[0], chunks[0]):
        rows = slice(begin, min(begin + chunks[0], values.shape[0]))
        stored[rows] = np.ascontiguousarray(values[rows])


class StoredGroup:
    """A group on disk, of whose arrays only the rows that are asked for are read.

    Parameters
    ----------
    directory : Path
        Of the group.
    kind : str
        What it is, for messages: such as ``run``.

    Attributes
    ----------
    name : str
        What messages call it.
    attributes : dict
        JSON data.

    Raises
    ------
    StoreError
        If there is no readable group.
    """

    def __init__(self, directory: Path, kind: str) -> None:
        self.name = f"{kind} {directory.name}"
        archive = directory / ARCHIVE
        with self._opening():
            self._file = ZipFile(archive) if archive.exists() else None
            self._members = None if self._file is None else Counter(_array_of_chunks(self._file))
            store = LocalStore(directory, read_only=True) if self._file is None else ZipStore(archive)
            self._group = zarr.open_group(store, mode="r", zarr_format=3)
        self._arrays: dict[str, zarr.Array[Any]] = {}
        self.attributes = dict(self._group.attrs)

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the shape of an array: first the number of its rows, which are samples or frames.

        Parameters
        ----------
        name : str

        Returns
        -------
        tuple of int

        Raises
        ------
        StoreError
            If the array is missing, incomplete or damaged.
        """
        return tuple(self._array(name).shape)

    def rows(self, name: str, numbers: range) -> Array:
        """Read some rows of an array.

        Parameters
        ----------
        name : str
        numbers : range
            Ascending numbers of rows that exist.  Chunks without any of them are not read.

        Returns
        -------
        (rows, ...)

        Raises
        ------
        StoreError
            If the array is missing, incomplete or damaged.
        """
        array = self._array(name)
        at_once = (array.shards or array.chunks)[0]
        found = []
        while numbers:
            end = (numbers[0] // at_once + 1) * at_once
            count = len(range(numbers[0], min(end, numbers.stop), numbers.step))
            here, numbers = numbers[:count], numbers[count:]
            found.append(self._read(name, slice(here[0], here[-1] + 1, here.step)))
        return np.concatenate(found) if found else np.empty((0, *array.shape[1:]))

    def whole(self, name: str) -> Array:
        """Read all of an array; see `rows`.

        Parameters
        ----------
        name : str

        Returns
        -------
        array
        """
        written = None if self._file is None else read_written(self._file, name)
        if written is not None:
            return written
        self._array(name)
        return self._read(name, ...)

    @contextmanager
    def _opening(self) -> Iterator[None]:
        try:
            yield
        except DAMAGE as error:
            raise StoreError(f"{self.name}: no readable group ({error})") from error

    def _array(self, name: str) -> zarr.Array[Any]:
        if name not in self._arrays:
            with self._decoding(name) as place:
                array = self._group[name]
                if not isinstance(array, zarr.Array):
                    raise StoreError(f"{place} is not an array")
                missing = array.nchunks - self._stored_chunks(name, array) if array.size else 0
                if missing:  # it would be read as fill values
                    raise StoreError(f"{place} has lost {missing} of {array.nchunks} chunks")
                self._arrays[name] = array
        return self._arrays[name]

    def _stored_chunks(self, name: str, array: zarr.Array[Any]) -> int:
        return array.nchunks_initialized if self._members is None else self._members[name]

    def _read(self, name: str, selection: Any) -> Array:
        with self._decoding(name):
            return np.asarray(self._arrays[name][selection], dtype=np.float64)

    @contextmanager
    def _decoding(self, name: str) -> Iterator[str]:
        place = f"{self.name}: array {name}"
        # Metadata and codecs fail in many ways (zarr, numcodecs, JSON); all of them mean the same here.
        try:
            yield place
        except StoreError:
            raise
        except KeyError as error:
            raise StoreError(f"{place} is missing") from error
        except Exception as error:
            raise StoreError(f"{place} cannot be decoded ({error})") from error


def _array_of_chunks(archive: ZipFile) -> Iterator[str]:
    """Yield, for each chunk in an archive, the name of its array."""
    # zarr's own count mistakes the chunks of `center_distance` for some of `center` in an archive.
    for member in archive.namelist():
        array, _, chunk = member.partition("/c/")
        if chunk:
            yield array
