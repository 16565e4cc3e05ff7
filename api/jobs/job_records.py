"""Jobs as they are sent: JSON straight from what the database holds, with no model in between."""

from __future__ import annotations

from functools import cache
from typing import Any

from pydantic_core import to_json
from sqlalchemy import ColumnElement, Integer, Row, Select, String, bindparam, select, type_coerce

from api.database.database_tables import JobRow, Moment
from api.database.service_database import Database
from api.jobs.job import Job, JobStatus, NoSuchJob
from ensemble.store import Record


def _as_stored(name: str) -> ColumnElement[Any]:
    """Column of a job's field; points in time are stored as the text that is sent."""
    column = getattr(JobRow, name)
    return type_coerce(column, String) if isinstance(column.type, Moment) else column


_FIELDS = tuple(Job.model_fields)
_STORED = select(*(_as_stored(name) for name in _FIELDS))
# Built once: to build a statement costs as much as the rest of a request for a job.
_ONE = _STORED.where(JobRow.id == bindparam("identifier"))


@cache
def _page(after: bool, owner: bool, status: bool) -> Select[Any]:
    """Return the statement for a page of jobs with these conditions."""
    query = _STORED.order_by(JobRow.number.desc()).limit(bindparam("limit", type_=Integer))
    if after:
        number = select(JobRow.number).where(JobRow.id == bindparam("after")).scalar_subquery()
        query = query.where(JobRow.number < number)
    if owner:
        query = query.where(JobRow.owner == bindparam("owner"))
    if status:
        query = query.where(JobRow.status == bindparam("status"))
    return query


class JobRecords:
    """Reads the jobs of a database, from any thread.

    Parameters
    ----------
    database : Database
        That has the jobs.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def one(self, identifier: str) -> Record:
        """Return a job.

        Parameters
        ----------
        identifier : str
            Of the job.

        Returns
        -------
        Record
            Its identifier and its JSON.

        Raises
        ------
        NoSuchJob
            If there is none.
        """
        with self._database.connect() as connection:
            row = connection.execute(_ONE, {"identifier": identifier}).one_or_none()
        if row is None:
            raise NoSuchJob(f"job: there is no job {identifier}")
        return _record(row)

    def page(
        self, limit: int, after: str | None = None, owner: str | None = None, status: JobStatus | None = None
    ) -> list[Record]:
        """Return jobs, the latest first.

        Parameters
        ----------
        limit : int
            How many at most.
        after : str, optional
            Identifier of the job before the first; by default the latest is the first.
        owner : str, optional
            Whose jobs.
        status : JobStatus, optional
            Which status they have.

        Returns
        -------
        list of Record
            Identifiers and JSON.

        Raises
        ------
        NoSuchJob
            If there is no job `after`.
        """
        if after is not None:
            self.one(after)
        query = _page(after is not None, owner is not None, status is not None)
        conditions = {"limit": limit, "after": after, "owner": owner, "status": status}
        with self._database.connect() as connection:
            return [_record(row) for row in connection.execute(query, conditions)]


def _record(row: Row[Any]) -> Record:
    return Record(row.id, to_json(dict(zip(_FIELDS, row, strict=True))).decode())
