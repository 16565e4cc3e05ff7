"""Arrays of a run as clients read them: diagnostics over time, and recorded states as points in the plane.

They are read and written piece by piece, so an answer needs little memory however long the run is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from pydantic import BaseModel
from pydantic_core import to_json

from ensemble.errors import BadInput
from ensemble.store.archive import StoredArrays
from ensemble.store.recorded_blocks import RecordedArray
from solver.analysis.run import Array
from solver.membrane.curve import positions

PIECE_VALUES = 1 << 16  # that are read and written at once


class SeriesDocument(BaseModel):
    """Diagnostics over time by name; null where a value is not finite.

    Attributes
    ----------
    series : dict
        Values by name, of the selected records.
    total : int
        Number of records of the run.
    """

    series: dict[str, list[float | None]]
    total: int


class FramesDocument(BaseModel):
    """Recorded states: the points of the membranes in the plane and the tensions at these points.

    Attributes
    ----------
    index : (frames,)
        Number of each frame in the run.
    time : (frames,)
    position : (frames, vesicles, 2, points)
        x of all points, then y.
    tension : (frames, vesicles, points)
    total : int
        Number of frames of the run.
    """

    index: list[int]
    time: list[float | None]
    position: list[list[list[list[float | None]]]]
    tension: list[list[list[float | None]]]
    total: int


class SeriesArrays(Protocol):
    """Diagnostics of a run, of which some rows are read.

    Attributes
    ----------
    series : sequence of str
        Their names.
    """

    @property
    def series(self) -> Sequence[str]:
        """The names of the diagnostics."""

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the shape of one: the number of its records.

        Parameters
        ----------
        name : str

        Returns
        -------
        tuple of int
        """

    def rows(self, name: str, numbers: range) -> Array:
        """Read some records of one.

        Parameters
        ----------
        name : str
        numbers : range
            Of records that exist, ascending.

        Returns
        -------
        (records,)
        """


class UnfinishedSeries:
    """Diagnostics of a run that is not done.

    Parameters
    ----------
    recorded : mapping of str to RecordedArray
        By name.

    Attributes
    ----------
    series : sequence of str
        Their names.
    """

    def __init__(self, recorded: Mapping[str, RecordedArray]) -> None:
        self._recorded = recorded
        self.series: Sequence[str] = sorted(recorded)

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the shape of one; see `SeriesArrays`.

        Parameters
        ----------
        name : str

        Returns
        -------
        tuple of int
        """
        return self._recorded[name].shape

    def rows(self, name: str, numbers: range) -> Array:
        """Read some records of one; see `SeriesArrays`.

        Parameters
        ----------
        name : str
        numbers : range

        Returns
        -------
        (records,)
        """
        return self._recorded[name][numbers.start : numbers.stop][:: numbers.step]


@dataclass(frozen=True)
class SeriesSelection:
    """Some of the records of some diagnostics of a run.

    Attributes
    ----------
    arrays : SeriesArrays
    names : sequence of str
    numbers : range
        Of the records.
    total : int
        Number of records of the run.
    """

    arrays: SeriesArrays
    names: Sequence[str]
    numbers: range
    total: int

    @classmethod
    def of(
        cls, arrays: SeriesArrays, names: Sequence[str], numbers: range, maximum_values: int
    ) -> SeriesSelection:
        """Select records.

        Parameters
        ----------
        arrays : SeriesArrays
            Of a run.
        names : sequence of str
            Names of diagnostics; if it is empty, all are selected.
        numbers : range
            Numbers of the records; those that the run does not have are left out.
        maximum_values : int
            Largest number of values.

        Returns
        -------
        SeriesSelection

        Raises
        ------
        BadInput
            If the run has no diagnostic of a name, or the records hold more values; the message says how
            many records are allowed.
        """
        present = arrays.series
        unknown = set(names) - set(present)
        if unknown:
            raise BadInput(f"name: {min(unknown)!r} — must be one of {', '.join(sorted(present))}")
        selected = sorted(set(names) or present)
        total = arrays.shape(selected[0])[0] if selected else 0
        numbers = _existing(numbers, total, max(len(selected), 1), maximum_values, "records")
        return cls(arrays, selected, numbers, total)

    def json(self) -> Iterator[bytes]:
        """Write the diagnostics as JSON.

        Yields
        ------
        bytes
            Pieces of a `SeriesDocument`.
        """
        yield b'{"series":{'
        for place, name in enumerate(self.names):
            yield b"," * (place > 0) + to_json(name) + b":"
            yield from _json_array(self.arrays.rows(name, rows) for rows in _blocks(self.numbers, 1))
        yield b'},"total":%d}' % self.total


@dataclass(frozen=True)
class FrameSelection:
    """Some of the frames of a run.

    Attributes
    ----------
    arrays : StoredArrays
    numbers : range
        Of the frames.
    total : int
        Number of frames of the run.
    values : int
        Number of values in a frame.
    """

    arrays: StoredArrays
    numbers: range
    total: int
    values: int

    @classmethod
    def of(cls, arrays: StoredArrays, numbers: range, maximum_values: int) -> FrameSelection:
        """Select frames.

        Parameters
        ----------
        arrays : StoredArrays
            Of a run.
        numbers : range
            Numbers of the frames; those that the run does not have are left out.
        maximum_values : int
            Largest number of values.

        Returns
        -------
        FrameSelection

        Raises
        ------
        BadInput
            If the frames hold more values; the message says how many frames are allowed.
        """
        total = arrays.shape("frame_time")[0]
        values = 1 + 3 * math.prod(arrays.shape("tangent_angle")[1:])
        return cls(arrays, _existing(numbers, total, values, maximum_values, "frames"), total, values)

    def json(self) -> Iterator[bytes]:
        """Write the frames as JSON.

        Yields
        ------
        bytes
            Pieces of a `FramesDocument`.
        """
        yield b'{"index":' + to_json(list(self.numbers)) + b',"time":'
        yield from _json_array(self._read(self._time))
        yield b',"position":'
        yield from _json_array(self._read(self._position))
        yield b',"tension":'
        yield from _json_array(self._read(self._tension))
        yield b',"total":%d}' % self.total

    @property
    def size(self) -> int:
        """Length of `binary` in bytes."""
        return 4 * self.values * len(self.numbers)

    def binary(self) -> Iterator[bytes]:
        """Write the frames as little-endian float32, one after the other.

        Yields
        ------
        bytes
            For each frame its time, then for each vesicle x of all points, y of all points and the tensions
            at these points.
        """
        for rows in _blocks(self.numbers, self.values):
            membranes = np.concatenate([self._position(rows), self._tension(rows)[:, :, None, :]], axis=2)
            flat = membranes.reshape(len(rows), -1)
            yield np.column_stack([self._time(rows), flat]).astype("<f4").tobytes()

    def _read(self, read: Callable[[range], Array]) -> Iterator[Array]:
        return map(read, _blocks(self.numbers, self.values))

    def _time(self, rows: range) -> Array:
        return self.arrays.rows("frame_time", rows)

    def _tension(self, rows: range) -> Array:
        return self.arrays.rows("tension", rows)

    def _position(self, rows: range) -> Array:
        lengths = np.array([vesicle.length for vesicle in self.arrays.summary.scene.vesicles])
        return positions(self.arrays.rows("tangent_angle", rows), self.arrays.rows("center", rows), lengths)


def centers(arrays: StoredArrays) -> Iterator[Array]:
    """Yield the centers of the vesicles in all recorded states of a run, piece by piece.

    Parameters
    ----------
    arrays : StoredArrays

    Yields
    ------
    (frames, vesicles, 2)
    """
    shape = arrays.shape("center")
    for rows in _blocks(range(shape[0]), math.prod(shape[1:])):
        yield arrays.rows("center", rows)


def _existing(numbers: range, total: int, values: int, maximum_values: int, what: str) -> range:
    """Return those of some rows that exist, if they are not too many."""
    existing = range(total)[numbers.start : numbers.stop : numbers.step]
    most = max(maximum_values // values, 1)
    if len(existing) > most:
        raise BadInput(
            f"stride: leaves {len(existing)} {what} — must leave at most {most} in one answer about this run"
        )
    return existing


def _blocks(numbers: range, values: int) -> Iterator[range]:
    """Cut rows of so many values into blocks of about `PIECE_VALUES`."""
    at_once = max(PIECE_VALUES // values, 1)
    for start in range(0, len(numbers), at_once):
        yield numbers[start : start + at_once]


def _json_array(pieces: Iterable[Array]) -> Iterator[bytes]:
    """Write arrays one after the other as one array of JSON, with null for what JSON cannot write."""
    yield b"["
    for place, piece in enumerate(pieces):
        yield b"," * (place > 0) + to_json(piece.tolist(), inf_nan_mode="null")[1:-1]
    yield b"]"
