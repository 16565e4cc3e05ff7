"""The catalog: which runs and boundaries exist, and their summaries, in SQL."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from sqlalchemy import Executable, Select, Text, bindparam, cast, delete, func, insert, or_, select, tuple_
from sqlalchemy.exc import DatabaseError
from sqlalchemy.orm import InstrumentedAttribute
from sqlalchemy.schema import CreateSchema

from ensemble.search.boundary import Boundary
from ensemble.store.catalog_tables import (
    BOUNDARY_FIELDS,
    RUN_FIELDS,
    BoundaryRow,
    Record,
    RunRow,
    Table,
)
from ensemble.store.filters import conditions, number, order, within
from ensemble.store.listing import BATCH, Listing, ParameterRange
from ensemble.store.record_fields import Fields
from ensemble.store.run_record import RunSummary
from ensemble.store.sql_database import Place, engine, reading_engine, transaction
from ensemble.timestamp import timestamp_text

# As text, since most of those who ask pass it on.
_RUN = select(RunRow.key, cast(RunRow.document, Text))
_BOUNDARY = select(BoundaryRow.study_key, cast(BoundaryRow.document, Text))
# Built once: to build a statement takes longer than to answer it.
_ONE_RUN = _RUN.where(RunRow.key == bindparam("key"))
_ONE_BOUNDARY = _BOUNDARY.where(BoundaryRow.study_key == bindparam("key"))


class Catalog:
    """Committed runs and boundaries in a database, from any thread.

    Parameters
    ----------
    place : Place
        Where the database is.
    read_only : bool
        Whether nothing is written: then no file appears beside that of the database.
    """

    def __init__(self, place: Place, read_only: bool = False) -> None:
        self._schema = place.schema_name
        # Not a write-ahead log: a store is copied, shared by a group and mounted read-only, and its readers
        # must leave nothing behind.
        made = reading_engine(place.url) if read_only else engine(place.url, journal="delete")
        self._engine = made.execution_options(schema_translate_map={None: place.schema_name})

    def require_writable(self) -> None:
        """Raise a database error unless a row could be written now."""
        with transaction(self._engine) as connection:
            # Changes nothing, and takes what a change takes: the lock, the journal and the permission.
            connection.execute(delete(RunRow).where(RunRow.key == ""))

    def require_whole(self) -> None:
        """Raise a database error unless the tables can be read and SQLite finds its file undamaged."""
        with self._engine.connect() as connection:
            if self._engine.dialect.name == "sqlite":
                (verdict,) = connection.exec_driver_sql("PRAGMA quick_check(1)").one()
                if verdict != "ok":
                    raise DatabaseError(None, None, ValueError(verdict))
            for table in (RunRow, BoundaryRow):
                connection.execute(select(table).limit(1))

    def remove(self, key: str) -> None:
        """Remove a run, so that it no longer exists.

        Parameters
        ----------
        key : str
            Of the run.
        """
        with transaction(self._engine) as connection:
            connection.execute(delete(RunRow).where(RunRow.key == key))

    def create(self) -> None:
        """Create the tables that are not there yet."""
        with transaction(self._engine) as connection:
            if self._schema is not None:
                connection.execute(CreateSchema(self._schema, if_not_exists=True))
            Table.metadata.create_all(connection)

    def close(self) -> None:
        """Close all connections."""
        self._engine.dispose()

    def insert(self, summaries: Iterable[RunSummary]) -> None:
        """Add runs; they exist from the moment that this returns, or none does.

        Parameters
        ----------
        summaries : iterable of RunSummary
        """
        rows = [
            {
                "key": summary.key,
                "created": timestamp_text(summary.created),
                "document": summary.document(),
            }
            for summary in summaries
        ]
        with transaction(self._engine) as connection:
            connection.execute(insert(RunRow), rows)

    def keys(self) -> set[str]:
        """Return the keys of all runs."""
        with self._engine.connect() as connection:
            return set(connection.scalars(select(RunRow.key)))

    def require_readable(self) -> None:
        """Raise a database error unless a run can be looked up."""
        with self._engine.connect() as connection:
            connection.execute(select(RunRow.key).limit(1))

    def count_runs(self) -> int:
        """Return how many runs there are."""
        with self._engine.connect() as connection:
            return connection.execute(select(func.count()).select_from(RunRow)).scalar_one()

    def keys_from(self, beginning: str, limit: int) -> list[str]:
        """Return keys of runs that begin alike, in ascending order.

        Parameters
        ----------
        beginning : str
            The first characters.
        limit : int
            How many keys at most.

        Returns
        -------
        list of str
        """
        query = select(RunRow.key).where(RunRow.key.startswith(beginning, autoescape=True))
        with self._engine.connect() as connection:
            return list(connection.scalars(query.order_by(RunRow.key).limit(limit)))

    def run(self, key: str) -> Record | None:
        """Return a run as it was recorded.

        Parameters
        ----------
        key : str

        Returns
        -------
        Record or None
            None if there is no such run.
        """
        return self._one(_ONE_RUN, key)

    def runs(self, listing: Listing) -> Iterator[Record]:
        """Find runs, the newest first unless the listing says otherwise.

        Parameters
        ----------
        listing : Listing

        Returns
        -------
        iterator of Record
            Only some of them are in memory at once, and between two of them the database is not locked.
        """
        row = RunRow
        return self._listed(listing, row.key, row.created, row.document, RUN_FIELDS, _RUN)

    def runs_of(self, keys: Sequence[str]) -> Iterator[Record]:
        """Look runs up.

        Parameters
        ----------
        keys : sequence of str

        Returns
        -------
        iterator of Record
            Those that are there, in the order of the keys; see `runs`.
        """
        return self._found(keys, _RUN, RunRow.key)

    def runs_within(self, ranges: Sequence[ParameterRange]) -> Iterator[Record]:
        """Find runs whose scenes have parameters within some ranges, one for each combination of values.

        Parameters
        ----------
        ranges : sequence of ParameterRange
            Of numbers in the scene.

        Returns
        -------
        iterator of Record
            See `runs`.
        """
        document = RunRow.document
        met = [within(each, document, RUN_FIELDS) for each in ranges]
        values = [number(each.path, document, RUN_FIELDS) for each in ranges]
        keys = select(func.min(RunRow.key)).where(*met).group_by(*values)
        return self._batches(keys, _RUN, RunRow.key)

    def runs_page(self, where: Sequence[str], after: str | None, limit: int) -> list[Record]:
        """Return a part of the runs that meet all filters, newest first.

        Parameters
        ----------
        where : sequence of str
            Filters, as `ensemble.store.filters` takes them.
        after : str or None
            Key of the run before the first one of the part; None for the newest runs.
        limit : int
            How many runs at most.

        Returns
        -------
        list of Record
        """
        query = _RUN.where(*conditions(where, RunRow.document, RUN_FIELDS))
        if after is not None:
            last = select(RunRow.created, RunRow.key).where(RunRow.key == after).scalar_subquery()
            query = query.where(tuple_(RunRow.created, RunRow.key) < last)
        return self._all(query.order_by(RunRow.created.desc(), RunRow.key.desc()).limit(limit))

    def put_boundary(self, boundary: Boundary) -> None:
        """Insert a boundary, or replace the one of the same study.

        Parameters
        ----------
        boundary : Boundary
        """
        row = {
            "study_key": boundary.study_key,
            "updated": timestamp_text(boundary.updated),
            "document": boundary.model_dump(mode="json"),
        }
        with transaction(self._engine) as connection:
            connection.execute(delete(BoundaryRow).where(BoundaryRow.study_key == boundary.study_key))
            connection.execute(insert(BoundaryRow), row)

    def boundary(self, study_key: str) -> Record | None:
        """Return the boundary of a study as it was recorded.

        Parameters
        ----------
        study_key : str

        Returns
        -------
        Record or None
            None if there is no such boundary.
        """
        return self._one(_ONE_BOUNDARY, study_key)

    def boundaries_named(self, name: str) -> list[Record]:
        """Return the boundaries of a name, or else those of its changed studies, or whose key begins so.

        Parameters
        ----------
        name : str
            Name of the study, with or without its changes, or the first characters of its key.

        Returns
        -------
        list of Record
            The latest change last.
        """
        by_change = _BOUNDARY.order_by(BoundaryRow.updated, BoundaryRow.study_key)
        has_name = BoundaryRow.document["name"].as_string() == name
        begins_so = or_(
            BoundaryRow.study_key.startswith(name, autoescape=True),
            BoundaryRow.document["name"].as_string().startswith(f"{name}, ", autoescape=True),
        )
        return self._all(by_change.where(has_name)) or self._all(by_change.where(begins_so))

    def boundaries(self, listing: Listing) -> Iterator[Record]:
        """Find boundaries, the latest change first unless the listing says otherwise.

        Parameters
        ----------
        listing : Listing

        Returns
        -------
        iterator of Record
            See `runs`.
        """
        row = BoundaryRow
        return self._listed(listing, row.study_key, row.updated, row.document, BOUNDARY_FIELDS, _BOUNDARY)

    def boundaries_page(self, where: Sequence[str], after: str | None, limit: int) -> list[Record]:
        """Return a part of the boundaries that meet all filters, by ascending key.

        Parameters
        ----------
        where : sequence of str
            Filters, as `ensemble.store.filters` takes them.
        after : str or None
            Key of the study before the first one of the part; None to begin.
        limit : int
            How many boundaries at most.

        Returns
        -------
        list of Record
        """
        # By key and not by time: a boundary that changes while somebody turns pages stays in its place.
        query = _BOUNDARY.where(*conditions(where, BoundaryRow.document, BOUNDARY_FIELDS))
        if after is not None:
            query = query.where(BoundaryRow.study_key > after)
        return self._all(query.order_by(BoundaryRow.study_key).limit(limit))

    def _one(self, query: Executable, key: str) -> Record | None:
        with self._engine.connect() as connection:
            row = connection.execute(query, {"key": key}).one_or_none()
        return None if row is None else Record(row[0], row[1])

    def _all(self, query: Executable) -> list[Record]:
        with self._engine.connect() as connection:
            return [Record(key, json) for key, json in connection.execute(query)]

    def _listed(
        self,
        listing: Listing,
        key: InstrumentedAttribute[str],
        moment: InstrumentedAttribute[str],
        document: InstrumentedAttribute[Any],
        fields: Fields,
        records: Select[str, str],
    ) -> Iterator[Record]:
        keys = select(key).where(*conditions(listing.where, document, fields))
        if listing.sort == moment.key:
            keys = keys.order_by(moment, key)
        elif listing.sort is not None:
            keys = keys.order_by(*order(listing.sort, document, fields))
        newest_first = keys.order_by(moment.desc(), key.desc())
        return self._batches(newest_first.limit(listing.limit), records, key)

    def _batches(
        self, keys: Select[str], records: Select[str, str], key: InstrumentedAttribute[str]
    ) -> Iterator[Record]:
        with self._engine.connect() as connection:
            found = [row[0] for row in connection.execute(keys)]
        yield from self._found(found, records, key)

    def _found(
        self, keys: Sequence[str], records: Select[str, str], key: InstrumentedAttribute[str]
    ) -> Iterator[Record]:
        for begin in range(0, len(keys), BATCH):
            batch = keys[begin : begin + BATCH]
            there = {record.key: record for record in self._all(records.where(key.in_(batch)))}
            yield from (there[each] for each in batch if each in there)  # one may be gone by now
