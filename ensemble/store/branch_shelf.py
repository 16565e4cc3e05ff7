"""Branches of steady states in a store: one group of arrays each, in the directory ``branches``.

A branch is written beside the runs that are being written, flushed to disk and renamed into ``branches``.
The rename makes it exist.  There are few branches, so the directory itself is their catalog.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ensemble.disk import flush, flush_tree, locked
from ensemble.errors import StoreError
from ensemble.search.branch_summary import BranchSummary, branch_key
from ensemble.store.branch_record import branch_arrays
from ensemble.store.shelf import Shelf
from ensemble.store.staging import STORE_LOCK
from ensemble.store.zarr_groups import write_group
from solver.revision import RESULTS_REVISION

if TYPE_CHECKING:
    from solver.simulation.steady_scenes import SteadyBranch

BRANCHES = "branches"


class BranchShelf(Shelf[BranchSummary]):
    """The branches of a store.

    Parameters
    ----------
    store : Path
        Directory of the store.
    """

    def __init__(self, store: Path) -> None:
        super().__init__(store, BRANCHES, "branch", BranchSummary)

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
        source._require_whole(key)
        self._keep(shutil.copytree(source.place(key), unfinished / f"{key}.branch"), key)

    def _keep(self, partial: Path, key: str) -> None:
        flush_tree(partial)
        with locked(self._store / STORE_LOCK):
            self._directory.mkdir(exist_ok=True)
            if self.contains(key):
                shutil.rmtree(partial)
            else:
                os.rename(partial, self._directory / key)
            flush(self._directory)

    def summaries(self) -> list[BranchSummary]:
        """Return the summaries of all branches, oldest first.

        A damaged one is left out, with a warning that names it.

        Returns
        -------
        list of BranchSummary
        """
        return sorted(self.readable(), key=lambda summary: summary.created)

    def _require_whole(self, key: str) -> None:
        group = self._group(key)
        summary = self._record_of(group)
        problems = []
        if summary.key != key:
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
