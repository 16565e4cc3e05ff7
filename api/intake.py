"""Jobs on their way to disk: those that arrive while a transaction is made durable share the next one."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Connection, func, select
from sqlalchemy.dialects import postgresql, sqlite

from api.database import Database
from api.job import UNFINISHED
from api.tables import JobRow

# The clause for conflicts is not in the SQL that all databases have in common.
_INSERT: Mapping[str, Any] = {"postgresql": postgresql.insert, "sqlite": sqlite.insert}


@dataclass(frozen=True)
class _Arrival:
    row: Mapping[str, Any]
    most_unfinished: int | None
    accepted: Future[bool] = field(default_factory=Future)


class Intake:
    """Adds jobs to a database, from any thread."""

    def __init__(self, database: Database) -> None:
        self._database = database
        # RETURNING names those that are new; an idempotency key that is there already adds no job.
        self._insert = _INSERT[database.dialect](JobRow).on_conflict_do_nothing().returning(JobRow.id)
        self._arrivals: deque[_Arrival] = deque()
        self._turn = threading.Lock()

    def add(self, row: Mapping[str, Any], most_unfinished: int | None) -> bool:
        """Add a job unless its owner has too many, or its idempotency key is there already.

        It is on disk when this returns True.
        """
        arrival = _Arrival(row, most_unfinished)
        self._arrivals.append(arrival)
        with self._turn:  # whoever has it acts for all who wait for it
            if not arrival.accepted.done():
                self._take_all()
        return arrival.accepted.result()

    def _take_all(self) -> None:
        arrivals = []
        while self._arrivals:  # one by one: another thread may be adding to them
            arrivals.append(self._arrivals.popleft())
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
    query = (
        select(JobRow.owner, func.count())
        .where(JobRow.owner.in_(owners), JobRow.status.in_(UNFINISHED))
        .group_by(JobRow.owner)
    )
    counted = dict.fromkeys(owners, 0)
    for owner, count in connection.execute(query):
        counted[owner] = count
    return counted
