"""Jobs on their way to disk: those that arrive while a transaction is made durable share the next one."""

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
_UNFINISHED = (
    select(JobRow.owner, func.count())
    .where(JobRow.owner.in_(bindparam("owners", expanding=True)), JobRow.status.in_(UNFINISHED))
    .group_by(JobRow.owner)
)


@dataclass(frozen=True)
class _Arrival:
    row: Mapping[str, Any]
    most_unfinished: int | None
    accepted: Future[bool] = field(default_factory=Future)


class Intake:
    """Adds jobs to a database, for any number of threads, from one of its own."""

    def __init__(self, database: Database) -> None:
        self._database = database
        # RETURNING names those that are new; an idempotency key that is there already adds no job.
        self._insert = _INSERT[database.dialect](JobRow).on_conflict_do_nothing().returning(JobRow.id)
        self._arrivals: list[_Arrival] = []
        self._changing = threading.Lock()
        self._writer = ThreadPoolExecutor(1, thread_name_prefix="intake")

    def add(self, row: Mapping[str, Any], most_unfinished: int | None) -> Future[bool]:
        """Add a job unless its owner has too many, or its idempotency key is there already.

        It is on disk when the future's result is True.
        """
        arrival = _Arrival(row, most_unfinished)
        with self._changing:
            self._arrivals.append(arrival)
            first = len(self._arrivals) == 1
        if first:  # who comes later is taken along with it
            self._writer.submit(self._take_all)
        return arrival.accepted

    def _take_all(self) -> None:
        with self._changing:
            arrivals, self._arrivals = self._arrivals, []
        try:
            with self._database.begin() as connection:
                new = self._new(connection, arrivals)
        except BaseException as error:
            for arrival in arrivals:
                arrival.accepted.set_exception(error)
        else:
            for arrival in arrivals:
                arrival.accepted.set_result(arrival.row["id"] in new)

    def _new(self, connection: Connection, arrivals: list[_Arrival]) -> set[str]:
        unfinished = _unfinished(connection, {arrival.row["owner"] for arrival in arrivals})
        rows = []
        for arrival in arrivals:
            owner = arrival.row["owner"]
            if arrival.most_unfinished is None or unfinished[owner] < arrival.most_unfinished:
                unfinished[owner] += 1
                rows.append(arrival.row)
        return set(connection.scalars(self._insert, rows)) if rows else set()


def _unfinished(connection: Connection, owners: set[str]) -> dict[str, int]:
    """How many jobs of each owner are not finished."""
    counted = dict.fromkeys(owners, 0)
    for owner, count in connection.execute(_UNFINISHED, {"owners": list(owners)}):
        counted[owner] = count
    return counted
