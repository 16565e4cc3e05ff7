"""The catalog: which runs and boundaries exist, and their summaries, in SQL."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sqlalchemy import JSON, URL, Engine, bindparam, create_engine, event, select, tuple_
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.orm import DeclarativeBase, Mapped, Session, mapped_column
from sqlalchemy.pool import ConnectionPoolEntry

from ensemble.boundary import Boundary
from ensemble.record import RunSummary
from ensemble.store.filters import conditions, model_fields
from ensemble.timestamp import timestamp_text
from solver.scene import Scene

BUSY_SECONDS = 60

# A filter names a field of the scene or a result; both have names of their own.
RUN_FIELDS = model_fields(Scene, "scene") | {
    name: field for name, field in model_fields(RunSummary).items() if name != "scene"
}
BOUNDARY_FIELDS = model_fields(Boundary)


class Table(DeclarativeBase):
    """Base of the tables."""

    type_annotation_map = {dict[str, Any]: JSON}  # noqa: RUF012


class RunRow(Table):
    """A committed run.  `document` is the JSON of its summary."""

    __tablename__ = "runs"

    key: Mapped[str] = mapped_column(primary_key=True)
    created: Mapped[str] = mapped_column(index=True)
    document: Mapped[dict[str, Any]]


class BoundaryRow(Table):
    """The latest state of a study's boundary."""

    __tablename__ = "boundaries"

    study_key: Mapped[str] = mapped_column(primary_key=True)
    updated: Mapped[str] = mapped_column(index=True)
    document: Mapped[dict[str, Any]]


# Made once: to make a statement takes longer than to answer it.
_DOCUMENT = select(RunRow.document).where(RunRow.key == bindparam("key"))


def _durable(connection: DBAPIConnection, _: ConnectionPoolEntry) -> None:
    cursor = connection.cursor()
    cursor.execute("PRAGMA journal_mode=WAL")  # readers see the store while a study writes
    cursor.execute("PRAGMA synchronous=FULL")  # an acknowledged commit outlives a power failure
    cursor.close()


class Catalog:
    """Committed runs and boundaries in an SQLite file, from any thread."""

    def __init__(self, path: Path) -> None:
        url = URL.create("sqlite", database=str(path))
        self._engine: Engine = create_engine(url, connect_args={"timeout": BUSY_SECONDS})
        event.listen(self._engine, "connect", _durable)

    def create(self) -> None:
        """Create the tables that are not there yet."""
        Table.metadata.create_all(self._engine)

    def close(self) -> None:
        """Close all connections."""
        self._engine.dispose()

    def insert(self, summary: RunSummary) -> None:
        """Add a run; it exists from the moment that this returns."""
        row = RunRow(key=summary.key, created=timestamp_text(summary.created), document=summary.document())
        with Session(self._engine) as session, session.begin():
            session.add(row)

    def keys(self) -> set[str]:
        """Keys of all runs."""
        with Session(self._engine) as session:
            return set(session.scalars(select(RunRow.key)))

    def document(self, key: str) -> dict[str, Any] | None:
        """JSON of the summary of one run, None if there is no such run."""
        with Session(self._engine) as session:
            return session.scalar(_DOCUMENT, {"key": key})

    def summaries(self, where: Sequence[str]) -> list[RunSummary]:
        """Summaries of the runs that meet all filters, oldest first."""
        query = (
            select(RunRow.document)
            .where(*conditions(where, RunRow.document, RUN_FIELDS))
            .order_by(RunRow.created, RunRow.key)
        )
        with Session(self._engine) as session:
            return [RunSummary.model_validate(document) for document in session.scalars(query)]

    def summaries_page(self, where: Sequence[str], after: str | None, limit: int) -> list[RunSummary]:
        """Summaries of at most `limit` runs, newest first, from the one that follows run `after`."""
        query = select(RunRow.document).where(*conditions(where, RunRow.document, RUN_FIELDS))
        if after is not None:
            last = select(RunRow.created, RunRow.key).where(RunRow.key == after).scalar_subquery()
            query = query.where(tuple_(RunRow.created, RunRow.key) < last)
        query = query.order_by(RunRow.created.desc(), RunRow.key.desc()).limit(limit)
        with Session(self._engine) as session:
            return [RunSummary.model_validate(document) for document in session.scalars(query)]

    def put_boundary(self, boundary: Boundary) -> None:
        """Insert a boundary, or replace the one of the same study."""
        row = BoundaryRow(
            study_key=boundary.study_key,
            updated=timestamp_text(boundary.updated),
            document=boundary.model_dump(mode="json"),
        )
        with Session(self._engine) as session, session.begin():
            session.merge(row)

    def boundaries(self, where: Sequence[str]) -> list[Boundary]:
        """Boundaries that meet all filters, the longest unchanged first."""
        query = (
            select(BoundaryRow.document)
            .where(*conditions(where, BoundaryRow.document, BOUNDARY_FIELDS))
            .order_by(BoundaryRow.updated, BoundaryRow.study_key)
        )
        with Session(self._engine) as session:
            return [Boundary.model_validate(document) for document in session.scalars(query)]

    def boundary(self, study_key: str) -> Boundary | None:
        """Boundary of one study, None if there is none."""
        with Session(self._engine) as session:
            row = session.get(BoundaryRow, study_key)
            return None if row is None else Boundary.model_validate(row.document)

    def boundaries_page(self, where: Sequence[str], after: str | None, limit: int) -> list[Boundary]:
        """At most `limit` boundaries by ascending key, from the one that follows study `after`."""
        # By key and not by time: a boundary that changes while somebody turns pages stays in its place.
        query = select(BoundaryRow.document).where(*conditions(where, BoundaryRow.document, BOUNDARY_FIELDS))
        if after is not None:
            query = query.where(BoundaryRow.study_key > after)
        query = query.order_by(BoundaryRow.study_key).limit(limit)
        with Session(self._engine) as session:
            return [Boundary.model_validate(document) for document in session.scalars(query)]
