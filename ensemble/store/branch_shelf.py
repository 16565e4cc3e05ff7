"""Branches of steady states in a store: one zarr v3 group each, in the directory ``branches``.

A branch is written beside the runs that are being written, flushed to disk and renamed into ``branches``.
The rename makes it exist.  There are few branches, so the directory itself is their catalog.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import zarr
from pydantic import ValidationError
from zarr.storage import LocalStore

from ensemble.disk import flush, flush_tree, locked
from ensemble.errors import StoreError
from ensemble.search.branch_summary import BranchSummary, branch_key
from ensemble.store.archive import write_array
from ensemble.store.branch_record import branch_arrays
from ensemble.store.run_record import first_problem
from ensemble.store.staging import STORE_LOCK, is_own_directory
from solver.analysis.run import Array
from solver.revision import RESULTS_REVISION

if TYPE_CHECKING:
    from solver.simulation.steady_scenes import SteadyBranch

BRANCHES = "branches"


class BranchShelf:
    """The branches of a store.

    Parameters
    ----------
    store : Path
        Directory of the store.
    """

    def __init__(self, store: Path) -> None:
        self._store = store
        self._branches = store / BRANCHES

    def save(self, summary: BranchSummary, branch: SteadyBranch, unfinished: Path) -> None:
        """Keep a branch, unless there is one with its key.

        Parameters
        ----------
        summary : BranchSummary
        branch : SteadyBranch
        unfinished : Path
            A directory of this process, which is swept if the process dies.
        """
        partial = unfinished / f"{summary.key}.branch"
        attributes = summary.model_dump(mode="json")
        group = zarr.create_group(LocalStore(partial), zarr_format=3, attributes=attributes)
        for name, array in branch_arrays(branch).items():
            write_array(group, name, array)
        flush_tree(partial)
        with locked(self._store / STORE_LOCK):
            self._branches.mkdir(exist_ok=True)
            if self.contains(summary.key):
                shutil.rmtree(partial)
            else:
                os.rename(partial, self._branches / summary.key)
            flush(self._branches)

    def contains(self, key: str) -> bool:
        """Tell whether there is a branch with this key.

        Parameters
        ----------
        key : str

        Returns
        -------
        bool
        """
        return is_own_directory(self._branches / key)

    def summary(self, key: str) -> BranchSummary:
        """Return everything about a branch except its arrays.

        Parameters
        ----------
        key : str

        Returns
        -------
        BranchSummary

        Raises
        ------
        StoreError
            If it is not there, or its files are damaged.
        """
        return _summary(self._branches / key, _group(self._branches / key))

    def summaries(self) -> list[BranchSummary]:
        """Return the summaries of all branches, oldest first.

        Returns
        -------
        list of BranchSummary
        """
        return sorted((self.summary(key) for key in self.keys()), key=lambda summary: summary.created)

    def problems(self) -> list[str]:
        """Verify every branch.

        Returns
        -------
        list of str
            One sentence each; empty if all are whole.
        """
        found = []
        for key in self.keys():
            try:
                found += _problems(self._branches / key)
            except StoreError as error:
                found.append(str(error))
        return found

    def keys(self) -> list[str]:
        """Return the keys of all branches, in their order.

        Returns
        -------
        list of str
        """
        if not self._branches.is_dir():
            return []
        return sorted(entry.name for entry in self._branches.iterdir() if is_own_directory(entry))


def _group(directory: Path) -> zarr.Group:
    try:
        return zarr.open_group(LocalStore(directory, read_only=True), mode="r", zarr_format=3)
    except (OSError, ValueError, KeyError) as error:
        raise StoreError(f"branch {directory.name}: no readable group ({error})") from error


def _summary(directory: Path, group: zarr.Group) -> BranchSummary:
    try:
        return BranchSummary.model_validate(dict(group.attrs))
    except ValidationError as error:
        raise StoreError(
            f"branch {directory.name}: unreadable attributes ({first_problem(error)})"
        ) from error


def _read(directory: Path, group: zarr.Group, name: str) -> Array:
    place = f"branch {directory.name}: array {name}"
    # Metadata and codecs fail in many ways (zarr, numcodecs, JSON); all of them mean the same here.
    try:
        array = group[name]
        if not isinstance(array, zarr.Array):
            raise StoreError(f"{place} is not an array")
        if array.nchunks_initialized < array.nchunks:
            raise StoreError(f"{place} has lost chunks")
        return np.asarray(array[...], dtype=np.float64)
    except StoreError:
        raise
    except Exception as error:
        raise StoreError(f"{place} cannot be read ({error})") from error


def _problems(directory: Path) -> list[str]:
    """Return what is wrong with the files of a branch."""
    name, group = f"branch {directory.name}", _group(directory)
    summary = _summary(directory, group)
    problems = []
    if summary.key != directory.name:
        problems.append(f"{name}: its attributes have the key {summary.key}")
    expected = branch_key(summary.scene, summary.parameter, summary.to)
    if summary.results_revision == RESULTS_REVISION and summary.key != expected:
        problems.append(f"{name}: its key is not that of its scene")
    vesicles = len(summary.scene.vesicles)
    parts = {"": summary.branch, "fold_": summary.folds, "crossing_": summary.crossings}
    for prefix, points in parts.items():
        if not points:
            continue
        values, angles, centers = (
            _read(directory, group, f"{prefix}{array}") for array in ("parameter", "tangent_angle", "center")
        )
        if not np.array_equal(values, [point.value for point in points]):
            problems.append(f"{name}: array {prefix}parameter differs from its attributes")
        for array, values in (("tangent_angle", angles), ("center", centers)):
            if values.shape[:2] != (len(points), vesicles) or not np.isfinite(values).all():
                problems.append(f"{name}: array {prefix}{array} is not that of its points")
    return problems
