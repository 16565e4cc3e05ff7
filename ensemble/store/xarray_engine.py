"""A store as xarray sees it: ``xarray.open_datatree("ensemble-store")`` opens all that it holds.

The entry point ``xarray.backends`` of the package names this module.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

from xarray import Dataset, DataTree
from xarray.backends import BackendEntrypoint

from ensemble.store.boundary_arrays import boundary_dataset
from ensemble.store.datasets import branch_dataset, run_dataset
from ensemble.store.map_arrays import map_dataset
from ensemble.store.store import Store
from ensemble.store.store_directory import exists


class StoreEntrypoint(BackendEntrypoint):
    """Opens a store as groups of data sets: ``/runs/KEY``, ``/boundaries/KEY`` and so on."""

    description: ClassVar[str] = "Stores of vesicle-ensemble"
    supports_groups: ClassVar[bool] = True

    def guess_can_open(self, filename_or_obj: Any) -> bool:
        """Tell whether something is the path of a store.

        Parameters
        ----------
        filename_or_obj : object

        Returns
        -------
        bool
        """
        return isinstance(filename_or_obj, str | os.PathLike) and exists(Path(filename_or_obj))

    def open_groups_as_dict(
        self, filename_or_obj: Any, *, drop_variables: Any = None, where: Sequence[str] = ()
    ) -> dict[str, Dataset]:
        """Open the runs, the boundaries, the maps and the branches of a store.

        Parameters
        ----------
        filename_or_obj : path
        drop_variables : str or iterable of str, optional
        where : sequence of str
            Only the runs that meet all of these conditions, as `ensemble query runs --where` takes them.

        Returns
        -------
        dict
            By the path of the group.  Records that this version cannot read are left out, with a warning.
        """
        with Store.existing(Path(filename_or_obj)) as store:
            groups = {"/": Dataset(), "/runs": Dataset()}
            groups |= {f"/runs/{each.key}": run_dataset(store.path, each) for each in store.summaries(where)}
            groups |= {f"/boundaries/{each.study_key}": boundary_dataset(each) for each in store.boundaries()}
            groups |= {f"/maps/{each.key}": map_dataset(each) for each in store.maps()}
            groups |= {
                f"/branches/{each.key}": branch_dataset(store.path, each)
                for each in store.branches.summaries()
            }
        return {path: data.drop_vars(drop_variables or (), errors="ignore") for path, data in groups.items()}

    def open_datatree(
        self, filename_or_obj: Any, *, drop_variables: Any = None, where: Sequence[str] = ()
    ) -> DataTree:
        """Open the runs, boundaries, maps and branches of a store; see `open_groups_as_dict`.

        Parameters
        ----------
        filename_or_obj : path
        drop_variables : str or iterable of str, optional
        where : sequence of str

        Returns
        -------
        DataTree
        """
        groups = self.open_groups_as_dict(filename_or_obj, drop_variables=drop_variables, where=where)
        return DataTree.from_dict(groups)

    def open_dataset(self, filename_or_obj: Any, *, drop_variables: Any = None, group: str = "/") -> Dataset:
        """Open one run.

        Parameters
        ----------
        filename_or_obj : path
        drop_variables : str or iterable of str, optional
        group : str
            ``runs/`` and the key of the run, or its beginning.

        Returns
        -------
        Dataset
        """
        shelf, _, key = group.strip("/").partition("/")
        if shelf != "runs" or not key:
            raise ValueError(f"group: {group!r} — must be runs/ and the key of a run, or its beginning")
        with Store.existing(Path(filename_or_obj)) as store:
            data = run_dataset(store.path, store.summary(store.full_key(key)))
        return data.drop_vars(drop_variables or (), errors="ignore")
