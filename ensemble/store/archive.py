"""Runs as zarr v3 groups, one directory each, that xarray opens as one data set."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from pydantic import ValidationError
from zarr.codecs import ZstdCodec
from zarr.storage import LocalStore

from ensemble.config.run_key import DISTRIBUTION
from ensemble.errors import OtherVersionError, StoreError
from ensemble.store.run_record import NamedArray, RunSummary, arrays, first_problem, rebuild
from solver.analysis.run import Array, Run

CHUNK_BYTES = 1 << 20


def _chunks(values: Array) -> tuple[int, ...]:
    """Chunk shape of at most about `CHUNK_BYTES`, cut along the first dimension (time) only."""
    bytes_each = max(values[:1].nbytes, 1)
    rows = min(max(CHUNK_BYTES // bytes_each, 1), values.shape[0])
    return tuple(max(length, 1) for length in (rows, *values.shape[1:]))


def write_array(group: zarr.Group, name: str, array: NamedArray) -> None:
    """Write an array to a group.

    Parameters
    ----------
    group : Group
        Of zarr.
    name : str
    array : NamedArray
    """
    group.create_array(
        name,
        data=np.ascontiguousarray(array.values),
        chunks=_chunks(array.values),
        # The checksum turns a flipped bit into an error instead of a different number.
        compressors=ZstdCodec(level=3, checksum=True),
        dimension_names=array.dimensions,
        fill_value=float("nan"),
        # Every chunk is a file, so a missing file is a loss and never an array of fill values.
        config={"write_empty_chunks": True},
    )


def write_run(directory: Path, summary: RunSummary, run: Run) -> None:
    """Write a run to a new directory.

    Parameters
    ----------
    directory : Path
    summary : RunSummary
        Of the run.
    run : Run
    """
    group = zarr.create_group(LocalStore(directory), zarr_format=3, attributes=summary.document())
    for name, array in arrays(run).items():
        write_array(group, name, array)


def _open(directory: Path) -> zarr.Group:
    try:
        return zarr.open_group(LocalStore(directory, read_only=True), mode="r", zarr_format=3)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise StoreError(f"run {directory.name}: no readable group ({error})") from error


def _summary(directory: Path, group: zarr.Group) -> RunSummary:
    try:
        return RunSummary.model_validate(dict(group.attrs))
    except ValidationError as error:
        written_by = dict(group.attrs).get("versions")
        if isinstance(written_by, dict) and DISTRIBUTION in written_by:
            raise OtherVersionError(
                f"run {directory.name}: version {written_by[DISTRIBUTION]} wrote it and this version cannot "
                f"read it ({first_problem(error)})"
            ) from error
        raise StoreError(f"run {directory.name}: unreadable attributes ({first_problem(error)})") from error


class StoredArrays:
    """The arrays of a run, of which only the rows that are asked for are read.

    Parameters
    ----------
    directory : Path
        Of the run.

    Attributes
    ----------
    summary : RunSummary

    Raises
    ------
    StoreError
        If there is no readable group, or its attributes are not those of a run.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._group = _open(directory)
        self._arrays: dict[str, zarr.Array[Any]] = {}
        self.summary = _summary(directory, self._group)

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
        self._array(name)
        return self._read(name, ...)

    def _array(self, name: str) -> zarr.Array[Any]:
        if name not in self._arrays:
            with self._decoding(name) as place:
                array = self._group[name]
                if not isinstance(array, zarr.Array):
                    raise StoreError(f"{place} is not an array")
                missing = array.nchunks - array.nchunks_initialized if array.size else 0
                if missing:  # it would be read as fill values
                    raise StoreError(f"{place} has lost {missing} of {array.nchunks} chunks")
                self._arrays[name] = array
        return self._arrays[name]

    def _read(self, name: str, selection: Any) -> Array:
        with self._decoding(name):
            return np.asarray(self._arrays[name][selection], dtype=np.float64)

    @contextmanager
    def _decoding(self, name: str) -> Iterator[str]:
        place = f"run {self._directory.name}: array {name}"
        # Metadata and codecs fail in many ways (zarr, numcodecs, JSON); all of them mean the same here.
        try:
            yield place
        except StoreError:
            raise
        except KeyError as error:
            raise StoreError(f"{place} is missing") from error
        except Exception as error:
            raise StoreError(f"{place} cannot be decoded ({error})") from error


def read_summary(directory: Path) -> RunSummary:
    """Read the attributes of a run.

    Parameters
    ----------
    directory : Path
        Of the run.

    Returns
    -------
    RunSummary

    Raises
    ------
    StoreError
        If there is no readable group, or its attributes are not those of a run.
    """
    return _summary(directory, _open(directory))


def read_run(directory: Path) -> Run:
    """Read a run; every number has the bits that were written.

    Parameters
    ----------
    directory : Path
        Of the run.

    Returns
    -------
    Run

    Raises
    ------
    StoreError
        If an array is missing, incomplete or damaged, or the attributes are not those of a run.
    """
    stored = StoredArrays(directory)
    return rebuild(stored.summary, stored.whole)
