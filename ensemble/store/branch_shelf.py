"""Branches of steady states in a store: one group of arrays each, in the directory ``branches``.

A branch is written beside the runs that are being written, flushed to disk and renamed into ``branches``.
The rename makes it exist.  There are few branches, so the directory itself is their catalog.
"""

from __future__ import annotations

import logging
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from pydantic import ValidationError

from ensemble.disk import flush, flush_tree, locked
from ensemble.errors import OtherVersionError, StoreError
from ensemble.search.branch_summary import BranchSummary, branch_key
from ensemble.store.branch_record import branch_arrays
from ensemble.store.run_record import first_problem
from ensemble.store.staging import STORE_LOCK
from ensemble.store.writers import is_own_directory
from ensemble.store.zarr_groups import StoredGroup, write_group
from solver.revision import RESULTS_REVISION

if TYPE_CHECKING:
    from solver.simulation.steady_scenes import SteadyBranch

BRANCHES = "branches"

_log = logging.getLogger(__name__)


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
        write_group(partial, summary.model_dump(mode="json"), branch_arrays(branch))
        self._keep(partial, summary.key)

    def copy(self, key: str, source: BranchShelf, unfinished: Path) -> None:
        """Copy a branch of another store, unless there is one with its key.

        Parameters
        ----------
        key : str
            Of a branch of the other store.
        source : BranchShelf
            The branches of the other store.
        unfinished : Path
            See `save`.

        Raises
        ------
        StoreError
            If the branch is damaged.
        """
        directory = source.place(key)
        _require_whole(directory)
        self._keep(shutil.copytree(directory, unfinished / f"{key}.branch"), key)

    def _keep(self, partial: Path, key: str) -> None:
        flush_tree(partial)
        with locked(self._store / STORE_LOCK):
            self._branches.mkdir(exist_ok=True)
            if self.contains(key):
                shutil.rmtree(partial)
            else:
                os.rename(partial, self._branches / key)
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

    def place(self, key: str) -> Path:
        """Return the directory of a branch.

        Parameters
        ----------
        key : str

        Returns
        -------
        Path
        """
        return self._branches / key

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
        OtherVersionError
            If this version cannot read it.
        """
        return _summary(StoredGroup(self._branches / key, "branch"))

    def summaries(self) -> list[BranchSummary]:
        """Return the summaries of all branches, oldest first.

        A damaged one is left out, with a warning that names it.

        Returns
        -------
        list of BranchSummary
        """
        return sorted(self._readable(), key=lambda summary: summary.created)

    def _readable(self) -> Iterator[BranchSummary]:
        for key in self.keys():
            try:
                yield self.summary(key)
            except StoreError as error:
                _log.warning("store: %s; left out", error)

    def problems(self) -> dict[str, StoreError]:
        """Verify every branch.

        Returns
        -------
        dict of str to StoreError
            What is wrong, by the keys of those that are not whole.
        """
        found = {}
        for key in self.keys():
            try:
                _require_whole(self.place(key))
            except StoreError as error:
                found[key] = error
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


def _summary(group: StoredGroup) -> BranchSummary:
    try:
        return BranchSummary.model_validate(group.attributes)
    except ValidationError as error:
        # An archive has checksums, so these are the attributes that were written.
        raise OtherVersionError(
            f"{group.name}: this version cannot read its record ({first_problem(error)})"
        ) from error


def _require_whole(directory: Path) -> None:
    """Raise an error that names what is wrong with the files of a branch, if anything is."""
    group = StoredGroup(directory, "branch")
    summary = _summary(group)
    problems = []
    if summary.key != directory.name:
        problems.append(f"its attributes have the key {summary.key}")
    expected = branch_key(summary.scene, summary.parameter, summary.to)
    if summary.results_revision == RESULTS_REVISION and summary.key != expected:
        problems.append("its key is not that of its scene")
    vesicles = len(summary.scene.vesicles)
    parts = {"": summary.branch, "fold_": summary.folds, "crossing_": summary.crossings}
    for prefix, points in parts.items():
        if not points:
            continue
        values, angles, centers = (
            group.whole(f"{prefix}{array}") for array in ("parameter", "tangent_angle", "center")
        )
        if not np.array_equal(values, [point.value for point in points]):
            problems.append(f"array {prefix}parameter differs from its attributes")
        for array, values in (("tangent_angle", angles), ("center", centers)):
            if values.shape[:2] != (len(points), vesicles) or not np.isfinite(values).all():
                problems.append(f"array {prefix}{array} is not that of its points")
    if problems:
        raise StoreError(f"{group.name}: {', '.join(problems)}")
