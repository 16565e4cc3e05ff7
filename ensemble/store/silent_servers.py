"""Connections to a PostgreSQL server that are given up when the server says nothing any more.

The driver waits without limit for a server that is suspended, or whose host is cut off.  A statement may take
long, so silence alone proves nothing: after a while a further connection shows whether the server lives.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import psycopg
from psycopg.abc import RV, PQGen
from sqlalchemy import Dialect
from sqlalchemy.pool import ConnectionPoolEntry

SILENT_SECONDS = 10.0  # after which a server is asked whether it lives


class WatchedConnection(psycopg.Connection[Any]):
    """A connection whose statements end with an error if the server does not answer."""

    _again: Callable[[], psycopg.Connection[Any]]

    @classmethod
    def to(cls, *arguments: Any, **parameters: Any) -> WatchedConnection:
        """Connect to a server.

        Parameters
        ----------
        *arguments, **parameters
            As for `psycopg.connect`; ``connect_timeout`` is also that of the further connection.

        Returns
        -------
        WatchedConnection
        """
        made = cls.connect(*arguments, **parameters)
        made._again = partial(psycopg.connect, *arguments, **parameters)
        return made

    def wait(self, gen: PQGen[RV], *arguments: Any, **named: Any) -> RV:
        """Wait for a statement; see `psycopg.Connection`.

        Parameters
        ----------
        gen : generator
        *arguments, **named

        Returns
        -------
        object
            What the generator returns.
        """
        return super().wait(self._watched(gen), *arguments, **named)

    def _watched(self, statement: PQGen[RV]) -> PQGen[RV]:
        """Pass on whether the server has said something, and raise an error if it does not live."""
        heard = time.monotonic()
        try:
            wanted = next(statement)
            while True:
                ready = yield wanted
                if ready:
                    heard = time.monotonic()
                elif time.monotonic() - heard > SILENT_SECONDS:
                    self._require_answer()
                    heard = time.monotonic()
                wanted = statement.send(ready)
        except StopIteration as end:
            result: RV = end.value
            return result

    def _require_answer(self) -> None:
        try:
            self._again().close()
        except psycopg.errors.ConnectionTimeout:
            self.pgconn.finish()
            raise psycopg.OperationalError("the server does not answer") from None
        except psycopg.OperationalError:
            pass  # it answers that it takes no further connection


def connect(
    dialect: Dialect, record: ConnectionPoolEntry, arguments: Sequence[Any], parameters: dict[str, Any]
) -> WatchedConnection:
    """Connect in place of the dialect: a listener to SQLAlchemy's event `do_connect`.

    Parameters
    ----------
    dialect : Dialect
    record : ConnectionPoolEntry
    arguments : sequence
    parameters : dict
        Arguments of the driver's function `connect`.

    Returns
    -------
    WatchedConnection
    """
    return WatchedConnection.to(*arguments, **parameters)
