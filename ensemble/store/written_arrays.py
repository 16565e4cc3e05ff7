"""Reads whole arrays of an archive in the form in which this package writes them, without zarr's event loop.

zarr takes a millisecond to open and read an array, however short: most of what a check of many runs costs.
What is not exactly of that form, damage included, is left to zarr.
"""

from __future__ import annotations

import json
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np
from numcodecs import Zstd

from solver.analysis.run import Array

# What a damaged archive, or damaged JSON, makes the readers raise.
DAMAGE = (OSError, ValueError, KeyError, TypeError, BadZipFile, NotImplementedError, EOFError)

# What `zarr_groups.write_group` gives zarr to write; the rest of the metadata depends on the array.
WRITTEN: dict[str, Any] = {
    "zarr_format": 3,
    "node_type": "array",
    "data_type": "float64",
    "fill_value": "NaN",
    "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
    "codecs": [
        {"name": "bytes", "configuration": {"endian": "little"}},
        {"name": "zstd", "configuration": {"level": 3, "checksum": True}},
    ],
    "storage_transformers": [],
}


def read_written(file: ZipFile, name: str) -> Array | None:
    """Read an array, if it is exactly as this package writes it.

    The checksums of the archive and of the chunks are verified.

    Parameters
    ----------
    file : ZipFile
        Open for reading.
    name : str
        Of the array.

    Returns
    -------
    array or None
        None if anything is different from what is written.
    """
    try:
        metadata = json.loads(file.read(f"{name}/zarr.json"))
        shape, rows = _layout(metadata)
        rest = "/0" * len(shape[1:])  # an array is cut along its first dimension only
        keys = [f"{name}/c/{number}{rest}" for number in range(-(-shape[0] // rows))]
        if sorted(keys) != sorted(key for key in file.namelist() if key.startswith(f"{name}/c/")):
            return None
        chunks = [_chunk(file.read(key), (rows, *shape[1:])) for key in keys]
    except (*DAMAGE, RuntimeError):  # the latter of the compression
        return None
    return np.concatenate(chunks)[: shape[0]] if chunks else np.empty(shape)


def _layout(metadata: dict[str, Any]) -> tuple[tuple[int, ...], int]:
    """Return the shape of an array and the rows of a chunk; an error if it is of another form."""
    shape, names = tuple(metadata.pop("shape")), metadata.pop("dimension_names")
    metadata.pop("attributes", None)  # descriptions and units
    grid = metadata.pop("chunk_grid")
    rows: int = grid["configuration"]["chunk_shape"][0]
    is_written = (
        metadata == WRITTEN
        and grid == {"name": "regular", "configuration": {"chunk_shape": [rows, *shape[1:]]}}
        and all(type(length) is int and length >= 0 for length in shape)
        and all(length > 0 for length in (rows, *shape[1:]))
        and len(names) == len(shape)
        and all(type(dimension) is str for dimension in names)
    )
    if not is_written:
        raise ValueError("another form")
    return shape, rows


def _chunk(compressed: bytes, shape: tuple[int, ...]) -> Array:
    return np.frombuffer(Zstd().decode(compressed), dtype="<f8").reshape(shape)
