"""Answers on a grid of parameters in a store: one group of arrays each, in a directory of their kind.

A group is written beside the runs that are being written, flushed to disk and put in its place by one
rename of its file.  It replaces the one of an earlier answer to the same question.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ensemble.config.question_key import QUESTION_KEY_DIGITS
from ensemble.disk import flush, flush_tree, locked
from ensemble.errors import StoreError
from ensemble.store.run_record import NamedArray
from ensemble.store.shelf import Shelf, SomeRecord
from ensemble.store.staging import STORE_LOCK
from ensemble.store.zarr_groups import ARCHIVE, StoredGroup, write_group


class GridShelf(Shelf[SomeRecord]):
    """The answers of one kind on a grid of parameters.

    Parameters
    ----------
    store : Path
        Directory of the store.
    folder : str
        Name of the directory in it.
    kind : str
        What an answer is, for messages: such as ``boundary``.
    model : type
        Of an answer without its arrays, which are its attributes.
    key_of : callable
        Takes an answer and returns its key.
    arrays : tuple of str
        Names of the arrays that each answer has.
    """

    def __init__(
        self,
        store: Path,
        folder: str,
        kind: str,
        model: type[SomeRecord],
        key_of: Callable[[SomeRecord], str],
        arrays: tuple[str, ...],
    ) -> None:
        super().__init__(store, folder, kind, model, QUESTION_KEY_DIGITS)
        self._key_of = key_of
        self._arrays = arrays

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
            place = self.place(key)
            if place.is_dir():
                os.replace(partial / ARCHIVE, place / ARCHIVE)
                flush(place)
            else:  # in one step, too: a directory without its file is one that has lost it
                self._directory.mkdir(exist_ok=True)
                os.rename(partial, place)
            flush(self._directory)
        shutil.rmtree(partial, ignore_errors=True)

    def read(self, key: str) -> SomeRecord:
        """Read an answer without its arrays; see `Shelf`.

        Parameters
        ----------
        key : str

        Returns
        -------
        BaseModel
            An instance of the model.

        Raises
        ------
        StoreError
            Also if its files are those of another one.
        """
        return self._answer_of(self._group(key), key)

    def _require_whole(self, key: str) -> None:
        group = self._group(key)
        self._answer_of(group, key)
        for array in self._arrays:
            group.whole(array)

    def _answer_of(self, group: StoredGroup, key: str) -> SomeRecord:
        answer = self._record_of(group)
        if self._key_of(answer) != key:
            raise StoreError(f"{group.name}: it is {self._kind} {self._key_of(answer)}")
        return answer
