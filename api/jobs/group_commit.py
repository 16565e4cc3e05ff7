"""New jobs on their way to disk: those that arrive while a transaction is made durable share the next one."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Connection, bindparam, func, select
from sqlalchemy.dialects import postgresql, sqlite

from api.database.database_tables import JobRow
from api.database.service_database import Database
from api.jobs.job import UNFINISHED

# The clause for conflicts is not in the SQL that all databases have in common.
_INSERT: Mapping[str, Any] = {"postgresql": postgresql.insert, "sqlite": sqlite.insert}
_COUNT_UNFINISHED = (
    select(JobRow.owner, func.count())
    .where(JobRow.owner.in_(bindparam("owners", expanding=True)), JobRow.status.in_(UNFINISHED))
    .group_by(JobRow.owner)
)


@dataclass(frozen=True)
class _NewJob:
    row: Mapping[str, Any]
    most_unfinished: int | None
    accepted: Future[bool] = field(default_factory=Future)


class GroupCommit:
    """Adds jobs to a database, for any number of threads, from a thread of its own.

    Parameters
    ----------
    database : Database
        That has the jobs.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        # RETURNING names the new ones: if the idempotency key exists already, no job is added.
        self._insert = _INSERT[database.dialect](JobRow).on_conflict_do_nothing().returning(JobRow.id)
        self._waiting: list[_NewJob] = []
        self._changing = threading.Lock()
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="group-commit")

    def add(self, row: Mapping[str, Any], most_unfinished: int | None) -> Future[bool]:
        """Add a job unless its owner has too many, or its idempotency key exists already.

        Parameters
        ----------
        row : mapping
            Columns of the job.
        most_unfinished : int or None
            How many unfinished jobs the owner may have, this one included.

        Returns
        -------
        Future
            Its result is whether the job was added; then it is on disk.
        """
        job = _NewJob(row, most_unfinished)
        with self._changing:
            self._waiting.append(job)
            is_first = len(self._waiting) == 1
        if is_first:  # those that come later are added together with it
            self._thread.submit(self._commit_waiting)
        return job.accepted

    def _commit_waiting(self) -> None:
        with self._changing:
            jobs, self._waiting = self._waiting, []
        try:
            with self._database.begin() as connection:
                added = self._add(connection, jobs)
        except BaseException as error:
            for job in jobs:
                job.accepted.set_exception(error)
        else:
            for job in jobs:
                job.accepted.set_result(job.row["id"] in added)

    def _add(self, connection: Connection, jobs: list[_NewJob]) -> set[str]:
        unfinished = _unfinished(connection, {job.row["owner"] for job in jobs})
        rows = []
        for job in jobs:
            owner = job.row["owner"]
            if job.most_unfinished is None or unfinished[owner] < job.most_unfinished:
                unfinished[owner] += 1
                rows.append(job.row)
        return set(connection.scalars(self._insert, rows)) if rows else set()


def _unfinished(connection: Connection, owners: set[str]) -> dict[str, int]:
    """How many unfinished jobs each owner has."""
    counts = dict.fromkeys(owners, 0)
    for owner, count in connection.execute(_COUNT_UNFINISHED, {"owners": list(owners)}):
        counts[owner] = count
    return counts
