"""Plain values (`solver.memory`) in one HDF5 file, from which they come back with their types and bits.

The shape of a value is a JSON text, the dataset ``structure``.  Its numbers stand one after the other in a
dataset for each of their types, such as ``float64``: thousands of small arrays cost no more than one.  Each
chunk has a checksum.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
from numpy.typing import NDArray

_STRUCTURE = "structure"
_BYTES = "uint8"


class UnreadableFileError(ValueError):
    """A file is damaged, or holds something else; the message is a few words that say why."""


def write_plain(path: Path, value: Any, attributes: Mapping[str, str | int]) -> None:
    """Write a value to a new file.

    Parameters
    ----------
    path : Path
    value : object
        Numbers, strings, None, arrays, and tuples, lists and dictionaries of such.
    attributes : mapping
        Of the file.

    Raises
    ------
    OSError
        If the disk does not take it.
    """
    encoder = _Encoder()
    structure = json.dumps(encoder.encoded(value), separators=(",", ":")).encode()
    try:
        with h5py.File(path, "w", locking=False) as file:  # not every file system has locks
            file.attrs.update(attributes)
            _put(file, _STRUCTURE, np.frombuffer(structure, dtype=_BYTES))
            for kind, parts in encoder.numbers.items():
                _put(file.require_group("numbers"), kind, np.concatenate(parts))
    except RuntimeError as error:  # what h5py makes of a write that fails when the file is closed
        raise OSError(str(error)) from error


def read_attributes(path: Path) -> dict[str, Any]:
    """Read the attributes of a file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    dict

    Raises
    ------
    UnreadableFileError
    """
    return _reading(path, lambda file: dict(file.attrs))


def read_plain(path: Path) -> Any:
    """Read the value in a file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    object
        As it was written.

    Raises
    ------
    UnreadableFileError
    """

    def read(file: h5py.File) -> Any:
        structure = json.loads(file[_STRUCTURE][:].tobytes())
        return _decoded(structure, {kind: each[:] for kind, each in file.get("numbers", {}).items()})

    return _reading(path, read)


def _reading(path: Path, read: Callable[[h5py.File], Any]) -> Any:
    try:
        with h5py.File(path, "r", locking=False) as file:
            return read(file)
    except (OSError, LookupError, TypeError, ValueError, RuntimeError) as error:
        number = getattr(error, "errno", None)  # of the operating system; what HDF5 says is of its own code
        raise UnreadableFileError(os.strerror(number) if number else "cut short or changed") from error


def _put(group: h5py.Group, name: str, numbers: NDArray[Any]) -> None:
    group.create_dataset(
        name, data=numbers, chunks=True if numbers.size else None, fletcher32=numbers.size > 0
    )


class _Encoder:
    """Turns a value into JSON, and collects its numbers by their type."""

    def __init__(self) -> None:
        self.numbers: dict[str, list[NDArray[Any]]] = {}
        self._sizes: dict[str, int] = {}

    def encoded(self, value: Any) -> Any:
        if isinstance(value, np.generic):
            return {"scalar": self._place(np.asarray(value))}
        if value is None or isinstance(value, (bool, int, float, str)):
            return value
        if isinstance(value, np.ndarray):
            order: Literal["C", "F"] = "F" if value.flags.fnc else "C"
            return {"array": [*self._place(value.ravel(order=order)), list(value.shape), order]}
        if isinstance(value, dict):
            return {"dict": [[self.encoded(key), self.encoded(each)] for key, each in value.items()]}
        if isinstance(value, tuple):
            return {"tuple": self._elements(value)}
        if isinstance(value, list):
            return {"list": self._elements(value)}
        raise TypeError(f"{type(value).__name__} is no plain value")

    def _elements(self, values: Sequence[Any]) -> Any:
        """Series of numbers are the most of what is remembered: those of one type need no structure."""
        kinds = {type(value) for value in values}
        if kinds in ({float}, {np.float64}):
            return {"of": kinds.pop().__name__, "at": self._place(np.array(values))}
        return [self.encoded(value) for value in values]

    def _place(self, numbers: NDArray[Any]) -> tuple[str, int, int]:
        kind = numbers.dtype.name
        begin = self._sizes.get(kind, 0)
        self._sizes[kind] = begin + numbers.size
        self.numbers.setdefault(kind, []).append(numbers.reshape(-1))
        return kind, begin, numbers.size


def _decoded(structure: Any, numbers: Mapping[str, NDArray[Any]]) -> Any:
    if not isinstance(structure, dict):
        return structure
    ((what, content),) = structure.items()
    if what == "scalar":
        return _taken(content, numbers)[0]
    if what == "array":
        *place, shape, order = content
        return _taken(place, numbers).reshape(shape, order=order).copy(order=order)
    if what == "dict":
        return {_decoded(key, numbers): _decoded(each, numbers) for key, each in content}
    elements = _elements(content, numbers)
    return tuple(elements) if what == "tuple" else elements


def _elements(content: Any, numbers: Mapping[str, NDArray[Any]]) -> list[Any]:
    if isinstance(content, dict):
        values = _taken(content["at"], numbers)
        return list(values) if content["of"] == "float64" else list(map(float, values))
    return [_decoded(each, numbers) for each in content]


def _taken(place: Sequence[Any], numbers: Mapping[str, NDArray[Any]]) -> NDArray[Any]:
    kind, begin, size = place
    return numbers[kind][begin : begin + size] if size else np.empty(0, dtype=kind)
