"""The database of the service: SQLite in the store, or PostgreSQL by its URL."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Self

from alembic import command
from alembic.config import Config
from sqlalchemy import Connection, Engine

from ensemble.disk import locked
from ensemble.errors import BadInput
from ensemble.store.sql_database import UNUSABLE, engine, reason

MIGRATIONS = "api:database/migrations"
LOCK = "database.lock"


class Database(AbstractContextManager["Database"]):
    """Connections to a database whose tables are up to date.  Get one from `Database.open`."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        # SQLite takes one writer at a time and lets the others sleep; threads that queue here lose no time.
        one_writer = engine.dialect.name == "sqlite"
        self._turn: AbstractContextManager[object] = threading.Lock() if one_writer else nullcontext()

    @classmethod
    def open(cls, url: str, directory: Path) -> Self:
        """Connect, and bring the tables up to date.

        Parameters
        ----------
        url : str
            For example ``sqlite:///jobs.sqlite`` or ``postgresql+psycopg://user@host/name``.
        directory : Path
            That all processes of the service share; a lock in it lets one of them at a time change tables.

        Raises
        ------
        BadInput
            If there is no such database or it cannot be used.
        """
        try:
            database = cls(engine(url))
            with locked(directory / LOCK):
                database._upgrade()
        except UNUSABLE as error:
            raise BadInput(f"database: it cannot be used ({reason(error)})") from error
        return database

    @property
    def dialect(self) -> str:
        """Which SQL it speaks, in SQLAlchemy's words."""
        return self._engine.dialect.name

    def _upgrade(self) -> None:
        config = Config()
        config.set_main_option("script_location", MIGRATIONS)
        with self._engine.begin() as connection:
            config.attributes["connection"] = connection
            command.upgrade(config, "head")

    @contextmanager
    def begin(self) -> Iterator[Connection]:
        """Give a connection for a change, which is durable when the block ends and undone if it fails."""
        with self._turn, self._engine.begin() as connection:
            yield connection

    def connect(self) -> AbstractContextManager[Connection]:
        """Give a connection for reading."""
        return self._engine.connect()

    def close(self) -> None:
        """Close all connections."""
        self._engine.dispose()

    def __exit__(self, *_: object) -> None:
        self.close()
