"""Answers of one kind in a store, a directory each in one directory, which is their catalog."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import Generic, TypeVar

from pydantic import BaseModel, ValidationError

from ensemble.errors import OtherVersionError, StoreError
from ensemble.store.run_record import first_problem
from ensemble.store.writers import DIGITS, is_own_directory
from ensemble.store.zarr_groups import StoredGroup

SomeRecord = TypeVar("SomeRecord", bound=BaseModel)

_log = logging.getLogger(__name__)


class Shelf(ABC, Generic[SomeRecord]):
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
    digits : int
        Hexadecimal ones of a key.  Directories with other names are not the store's.
    """

    def __init__(
        self, store: Path, folder: str, kind: str, model: type[SomeRecord], digits: int = DIGITS
    ) -> None:
        self._store = store
        self._directory = store / folder
        self._kind = kind
        self._model = model
        self._digits = digits

    def read(self, key: str) -> SomeRecord:
        """Read an answer without its arrays.

        Parameters
        ----------
        key : str

        Returns
        -------
        BaseModel

        Raises
        ------
        StoreError
            If it is not there, or its files are damaged.
        OtherVersionError
            If this version cannot read it.
        """
        return self._record_of(self._group(key))

    @abstractmethod
    def _require_whole(self, key: str) -> None:
        """Raise a `StoreError` that names what is wrong with the files of an answer, if anything is."""

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

    def contains(self, key: str) -> bool:
        """Tell whether there is an answer with this key.

        Parameters
        ----------
        key : str

        Returns
        -------
        bool
        """
        return is_own_directory(self.place(key), self._digits)

    def keys(self) -> list[str]:
        """Return the keys of all answers, damaged ones too, in their order.

        Returns
        -------
        list of str
        """
        if not self._directory.is_dir():
            return []
        return sorted(
            entry.name for entry in self._directory.iterdir() if is_own_directory(entry, self._digits)
        )

    def readable(self) -> Iterator[SomeRecord]:
        """Read all answers without their arrays, leaving out damaged ones, with a warning that names each.

        Yields
        ------
        BaseModel
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
                self._require_whole(key)
            except StoreError as error:
                found[key] = error
        return found

    def _group(self, key: str) -> StoredGroup:
        return StoredGroup(self.place(key), self._kind)

    def _record_of(self, group: StoredGroup) -> SomeRecord:
        try:
            return self._model.model_validate(group.attributes)
        except ValidationError as error:
            # An archive has checksums, so these are the attributes that were written.
            raise OtherVersionError(
                f"{group.name}: this version cannot read its record ({first_problem(error)})"
            ) from error
