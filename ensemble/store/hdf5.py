"""Single files in HDF5: checkpoints of a running simulation and exports of a finished run.

A file is written under a temporary name beside its destination, flushed to disk and then put in place, so at
every moment the destination is a whole file, the old one or the new one.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ensemble.store.disk import flush
from ensemble.store.run_record import RunSummary, arrays
from solver.analysis.run import Run


def write_hdf5(path: Path, arrays: Mapping[str, NDArray[Any]], attributes: Mapping[str, Any]) -> None:
    """Write or replace a file at once.

    Parameters
    ----------
    path : Path
        Destination, with one writer at a time; its directory exists.  A writer that was killed leaves
        ``<name>.partial`` beside it, which the next one overwrites.
    arrays : mapping of name to array
        One data set each, any shape and numeric type.
    attributes : mapping of name to JSON data
        One attribute of the root each, as JSON text: None, nesting and every bit of a float survive.

    Raises
    ------
    TypeError
        If an attribute is not JSON data.  The destination is then unchanged.
    """
    partial = path.with_name(path.name + ".partial")
    try:
        # Attributes beyond 64 KiB (a scene of many vesicles) need the 1.8 file format or later.
        with h5py.File(partial, "w", libver=("v108", "v110")) as file:
            for name, values in arrays.items():
                file.create_dataset(name, data=values)
            for name, value in attributes.items():
                file.attrs[name] = json.dumps(value)
        flush(partial)
        os.replace(partial, path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    flush(path.parent)


def read_hdf5(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Read what `write_hdf5` wrote: arrays and attributes by name.

    Raises
    ------
    OSError
        If there is no such file, or it is not HDF5.
    """
    with h5py.File(path, "r") as file:
        return (
            {name: np.asarray(data[()]) for name, data in file.items()},
            {name: json.loads(text) for name, text in file.attrs.items()},
        )


def export(summary: RunSummary, run: Run, path: Path) -> None:
    """Write a run and its summary to a single HDF5 file, with the names that its group in the store has."""
    write_hdf5(path, {name: array.values for name, array in arrays(run).items()}, summary.document())
