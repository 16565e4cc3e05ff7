"""Answers on a grid of parameters in a store: one group of arrays each, in a directory of their kind.

A group is written beside the runs that are being written, flushed to disk and put in its place by one
rename of its file.  It replaces the one of an earlier answer to the same question.
"""

from __future__ import annotations

import logging
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, ValidationError

from ensemble.disk import flush, flush_tree, locked
from ensemble.errors import OtherVersionError, StoreError
from ensemble.store.run_record import NamedArray, first_problem
from ensemble.store.staging import STORE_LOCK
from ensemble.store.zarr_groups import ARCHIVE, StoredGroup, write_group

SomeAnswer = TypeVar("SomeAnswer", bound=BaseModel)

_log = logging.getLogger(__name__)


class GridShelf(Generic[SomeAnswer]):
    """The answers of one kind in a store.

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
        model: type[SomeAnswer],
        key_of: Callable[[SomeAnswer], str],
        arrays: tuple[str, ...],
    ) -> None:
        self._store = store
        self._directory = store / folder
        self._kind = kind
        self._model = model
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

    def keys(self) -> list[str]:
        """Return the keys of all answers, damaged ones too, in their order."""
        if not self._directory.is_dir():
            return []
        return sorted(place.name for place in self._directory.iterdir() if place.is_dir())

    def place(self, key: str) -> Path:
        """Return the directory of an answer.

        Parameters
        ----------
        key : str

        Returns
        -------
        Path
        """
        return self._directory / key

    def read(self, key: str) -> SomeAnswer:
        """Read an answer without its arrays.

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
            If it is not there, its files are damaged, or they are those of another one.
        OtherVersionError
            If this version cannot read it.
        """
        return self._answer_of(self._group(key), key)

    def readable(self) -> Iterator[SomeAnswer]:
        """Read all answers without their arrays, leaving out damaged ones, with a warning that names each.

        Yields
        ------
        BaseModel
            An instance of the model.
        """
        for key in self.keys():
            try:
                answer = self.read(key)
            except StoreError as error:
                _log.warning("store: %s; left out", error)
            else:
                yield answer

    def problems(self) -> dict[str, StoreError]:
        """Verify every answer.

        Returns
        -------
        dict of str to StoreError
            What is wrong, by the keys of those that are not whole.
        """
        found = {}
        for key in self.keys():
            try:
                group = self._group(key)
                self._answer_of(group, key)
                for array in self._arrays:
                    group.whole(array)
            except StoreError as error:
                found[key] = error
        return found

    def _group(self, key: str) -> StoredGroup:
        return StoredGroup(self.place(key), self._kind)

    def _answer_of(self, group: StoredGroup, key: str) -> SomeAnswer:
        try:
            answer = self._model.model_validate(group.attributes)
        except ValidationError as error:
            # An archive has checksums, so these are the attributes that were written.
            raise OtherVersionError(
                f"{group.name}: this version cannot read its record ({first_problem(error)})"
            ) from error
        if self._key_of(answer) != key:
            raise StoreError(f"{group.name}: it is {self._kind} {self._key_of(answer)}")
        return answer
