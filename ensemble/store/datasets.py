"""Runs and branches of a store as data sets of xarray.

Arrays of runs are read when they are used, and no file stays open in between.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from xarray import Dataset, Variable
from xarray.backends import BackendArray
from xarray.core import indexing

from ensemble.search.branch_summary import BranchSummary
from ensemble.store.branch_record import branch_dimensions
from ensemble.store.branch_shelf import BRANCHES
from ensemble.store.run_record import Rows, RunSummary, named_arrays
from ensemble.store.staging import RUNS
from ensemble.store.zarr_groups import StoredGroup
from solver.analysis.run import Array
from solver.membrane.curve import positions


class StoredRows:
    """An array of a store, or one that follows from such, of which only those rows are read that are used.

    Parameters
    ----------
    shape : tuple of int
    read : callable
        Takes a range of ascending rows and returns them.
    """

    def __init__(self, shape: tuple[int, ...], read: Callable[[range], Array]) -> None:
        self.shape = shape
        self.dtype = np.dtype(np.float64)
        self._read = read

    def __getitem__(self, rows: slice) -> Array:
        return self._read(range(self.shape[0])[rows])


class LazyArray(BackendArray):
    """The rows of an array as xarray asks for them.

    Parameters
    ----------
    rows : Rows
    """

    def __init__(self, rows: Rows) -> None:
        self._rows, self.shape, self.dtype = rows, rows.shape, rows.dtype

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(
            key, self.shape, indexing.IndexingSupport.BASIC, self._selected
        )

    def _selected(self, key: tuple[Any, ...]) -> Any:
        first, *others = key
        numbers = range(self.shape[0])[first]
        if isinstance(numbers, int):
            return self._rows[slice(numbers, numbers + 1)][(0, *others)]
        ascending = numbers if numbers.step > 0 else numbers[::-1]
        rows = self._rows[slice(ascending.start, ascending.stop, ascending.step)]
        return rows[(slice(None, None, 1 if numbers.step > 0 else -1), *others)]


def run_dataset(store: Path, summary: RunSummary) -> Dataset:
    """Return the arrays of a run, with ``x`` and ``y`` of the points of its membranes.

    Parameters
    ----------
    store : Path
        Directory of the store.
    summary : RunSummary

    Returns
    -------
    Dataset
        ``time``, ``frame_time`` and the summary, as attributes, are in memory.  The other arrays are read,
        and points computed, when they are used.
    """
    directory = store / RUNS / summary.key
    group = StoredGroup(directory, "run")
    time, frame_time = group.whole("time"), group.whole("frame_time")
    vesicles = summary.scene.vesicles
    points = summary.work.points or group.shape("tangent_angle")[-1]  # not in old records
    at_points = len(frame_time), len(vesicles), points
    lengths = np.array([vesicle.length for vesicle in vesicles])

    def stored(name: str, shape: tuple[int, ...]) -> StoredRows:
        return StoredRows(shape, partial(_stored_rows, directory, name))

    frames: dict[str, Rows] = {
        "time": frame_time,
        "tangent_angle": stored("tangent_angle", at_points),
        "center": stored("center", (*at_points[:2], 2)),
        "tension": stored("tension", at_points),
    }
    for component, name in enumerate("xy"):
        frames[name] = StoredRows(at_points, partial(_points, directory, lengths, component))
    parts: dict[str, dict[str, Rows]] = {
        "series": {name: stored(name, time.shape) for name in summary.series} | {"time": time},
        "vesicle_series": {name: stored(name, group.shape(name)) for name in summary.vesicle_series},
        "frames": frames,
    }
    variables = {
        name: Variable(array.dimensions, _in_memory_or_lazy(array.values), array.attributes)
        for name, array in named_arrays(parts, summary.scene.units).items()
    }
    return Dataset(variables, attrs=summary.document()).set_coords(["x", "y"])


def _in_memory_or_lazy(values: Rows) -> Any:
    return values if isinstance(values, np.ndarray) else indexing.LazilyIndexedArray(LazyArray(values))


def _stored_rows(directory: Path, name: str, rows: range) -> Array:
    return StoredGroup(directory, "run").rows(name, rows)


def _points(directory: Path, lengths: Array, component: int, rows: range) -> Array:
    group = StoredGroup(directory, "run")
    points = positions(group.rows("tangent_angle", rows), group.rows("center", rows), lengths)
    return points[:, :, component]


def branch_dataset(store: Path, summary: BranchSummary) -> Dataset:
    """Return the arrays of a branch of steady states, and of its folds and crossings.

    Parameters
    ----------
    store : Path
        Directory of the store.
    summary : BranchSummary

    Returns
    -------
    Dataset
        In memory; the summary are its attributes.
    """
    group = StoredGroup(store / BRANCHES / summary.key, "branch")
    parts = {"": summary.branch, "fold_": summary.folds, "crossing_": summary.crossings}
    variables = {
        name: Variable(dimensions, group.whole(name))
        for prefix, points in parts.items()
        if points
        for name, dimensions in branch_dimensions(prefix).items()
    }
    return Dataset(variables, attrs=summary.document())
