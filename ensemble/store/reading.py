"""Reads records of the catalog as the models of this version."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from typing import TypeVar

from pydantic import ValidationError

from ensemble.errors import OtherVersionError
from ensemble.search.boundary import Boundary
from ensemble.store.catalog_tables import Record
from ensemble.store.run_record import RunSummary, first_problem

_log = logging.getLogger(__name__)

AnyDocument = TypeVar("AnyDocument", RunSummary, Boundary)


def validated(model: type[AnyDocument], kind: str, record: Record) -> AnyDocument:
    """Read a record of the catalog.

    Parameters
    ----------
    model : type
        `RunSummary` or `Boundary`.
    kind : str
        Its name in messages.
    record : Record

    Returns
    -------
    RunSummary or Boundary

    Raises
    ------
    OtherVersionError
        If this version cannot.
    """
    try:
        return model.model_validate_json(record.json)
    except ValidationError as error:
        raise OtherVersionError(
            f"{kind} {record.key}: this version cannot read its record ({first_problem(error)})"
        ) from error


def readable(model: type[AnyDocument], kind: str, records: Iterable[Record]) -> Iterator[AnyDocument]:
    """Read records, leaving out those that this version cannot read, with a warning that names each.

    Parameters
    ----------
    model : type
        `RunSummary` or `Boundary`.
    kind : str
        Its name in messages.
    records : iterable of Record

    Yields
    ------
    RunSummary or Boundary
    """
    for record in records:
        try:
            yield validated(model, kind, record)
        except OtherVersionError as error:
            _log.warning("store: %s; left out", error)
