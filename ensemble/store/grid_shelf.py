"""Answers on a grid of parameters in a store: one group of arrays each, in a directory of their kind.

A group is written beside the runs that are being written, flushed to disk and put in its place by one
rename of its file.  It replaces the one of an earlier answer to the same question.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from ensemble.disk import flush, flush_tree, locked
from ensemble.errors import StoreError
from ensemble.store.run_record import NamedArray, first_problem
from ensemble.store.staging import STORE_LOCK
from ensemble.store.zarr_groups import ARCHIVE, StoredGroup, write_group

SomeAnswer = TypeVar("SomeAnswer", bound=BaseModel)


class GridShelf:
    """The answers of one kind in a store.

    Parameters
    ----------
    store : Path
        Directory of the store.
    folder : str
        Name of the directory in it.
    kind : str
        What an answer is, for messages: such as ``boundary``.
    """

    def __init__(self, store: Path, folder: str, kind: str) -> None:
        self._store = store
        self._directory = store / folder
        self._kind = kind

    def save(
        self, key: str, attributes: dict[str, Any], arrays: Mapping[str, NamedArray], unfinished: Path
    ) -> None:
        """Keep an answer instead of the one with its key.

        Parameters
        ----------
        key : str
        attributes : dict
            JSON data.
        arrays : mapping of str to NamedArray
        unfinished : Path
            A directory of this process, which is swept if the process dies.
        """
        partial = unfinished / f"{key}.{self._kind}"
        write_group(partial, attributes, arrays)
        flush_tree(partial)
        with locked(self._store / STORE_LOCK):
            place = self._directory / key
            place.mkdir(parents=True, exist_ok=True)
            os.replace(partial / ARCHIVE, place / ARCHIVE)
            flush(place)
            flush(self._directory)
        shutil.rmtree(partial)

    def keys(self) -> list[str]:
        """Return the keys of all answers, in their order."""
        if not self._directory.is_dir():
            return []
        return sorted(place.parent.name for place in self._directory.glob(f"*/{ARCHIVE}"))

    def group(self, key: str) -> StoredGroup:
        """Open an answer.

        Parameters
        ----------
        key : str

        Returns
        -------
        StoredGroup

        Raises
        ------
        StoreError
            If it is not there, or its files are damaged.
        """
        return StoredGroup(self._directory / key, self._kind)

    def read(self, key: str, model: type[SomeAnswer]) -> SomeAnswer:
        """Read an answer without its arrays.

        Parameters
        ----------
        key : str
        model : type
            Of its attributes.

        Returns
        -------
        BaseModel
            An instance of the model.

        Raises
        ------
        StoreError
            If it is not there, or its files are damaged.
        """
        group = self.group(key)
        try:
            return model.model_validate(group.attributes)
        except ValidationError as error:
            raise StoreError(f"{group.name}: unreadable attributes ({first_problem(error)})") from error

    def problems(self, arrays: tuple[str, ...]) -> list[str]:
        """Verify every answer.

        Parameters
        ----------
        arrays : tuple of str
            Names of arrays that each has.

        Returns
        -------
        list of str
            One sentence each; empty if all are whole.
        """
        found = []
        for key in self.keys():
            try:
                group = self.group(key)
                for array in arrays:
                    group.whole(array)
            except StoreError as error:
                found.append(str(error))
        return found
