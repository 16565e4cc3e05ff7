"""Access to the database of the service: SQLite in the store, or PostgreSQL by its URL."""

from __future__ import annotations

import threading
from collections.abc import Awaitable, Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import ParamSpec, Protocol, Self, TypeVar

from alembic import command
from alembic.config import Config
from anyio import fail_after, to_thread
from sqlalchemy import Connection, Engine
from sqlalchemy.exc import OperationalError

from ensemble.disk import locked
from ensemble.errors import BadInput
from ensemble.store.sql_database import (
    UNUSABLE,
    engine,
    is_file,
    is_locked,
    reason,
    transaction,
    without_waiting,
)

MIGRATIONS = "api:database/migrations"
LOCK = "database.lock"
READING_SECONDS = 10.0  # for one record

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


class Database(AbstractContextManager["Database"]):
    """Connections to a database whose tables are up to date.

    Call `Database.open` to get one.

    Parameters
    ----------
    engine : Engine
        SQLAlchemy's engine.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        # SQLite allows one writer at a time and lets others sleep and retry. Waiting for a lock is faster.
        is_sqlite = engine.dialect.name == "sqlite"
        self._write_lock: AbstractContextManager[object] = threading.Lock() if is_sqlite else nullcontext()

    @classmethod
    def open(cls, url: str, directory: Path) -> Self:
        """Connect, and migrate the tables to the present version.

        Parameters
        ----------
        url : str
            For example ``sqlite:///jobs.sqlite`` or ``postgresql+psycopg://user@host/name``.
        directory : Path
            A directory that all processes of the service share. A lock file in it lets one process at a
            time migrate tables.

        Returns
        -------
        Database

        Raises
        ------
        BadInput
            If the database does not exist or cannot be used.
        """
        try:
            database = cls(engine(url))
            with locked(directory / LOCK):
                database._migrate()
        except UNUSABLE as error:
            raise BadInput(f"database: it cannot be used ({reason(error)})") from error
        return database

    @property
    def dialect(self) -> str:
        """Name of the SQL dialect in SQLAlchemy: ``sqlite`` or ``postgresql``."""
        return self._engine.dialect.name

    def _migrate(self) -> None:
        config = Config()
        config.set_main_option("script_location", MIGRATIONS)
        with self._engine.begin() as connection:
            config.attributes["connection"] = connection
            command.upgrade(config, "head")

    @contextmanager
    def begin(self) -> Iterator[Connection]:
        """Open a transaction: durable when the block ends, rolled back if the block raises."""
        with self._write_lock, transaction(self._engine) as connection:
            yield connection

    def connect(self) -> AbstractContextManager[Connection]:
        """Open a connection for reading."""
        return self._engine.connect()

    def close(self) -> None:
        """Close all connections."""
        self._engine.dispose()

    def __exit__(self, *_: object) -> None:
        self.close()


class LookUp(Protocol):
    """How coroutines read one record: `read_inline` or `read_in_thread`."""

    def __call__(
        self,
        read: Callable[Arguments, Result],
        /,
        *arguments: Arguments.args,
        **named: Arguments.kwargs,
    ) -> Awaitable[Result]:
        """Call `read` with the arguments and return its result.

        Parameters
        ----------
        read : callable
        *arguments, **named
            Arguments of `read`.

        Returns
        -------
        awaitable
        """
        ...


async def read_inline(
    read: Callable[Arguments, Result], /, *arguments: Arguments.args, **named: Arguments.kwargs
) -> Result:
    """Call a function in the event loop itself, or in another thread while the file is locked; see `LookUp`.

    Parameters
    ----------
    read : callable
    *arguments, **named
        Arguments of `read`.

    Returns
    -------
    object
        The result of `read`.
    """
    try:
        with without_waiting():
            return read(*arguments, **named)
    except OperationalError as error:
        if not is_locked(error):
            raise
    return await read_in_thread(read, *arguments, **named)


async def read_in_thread(
    read: Callable[Arguments, Result], /, *arguments: Arguments.args, **named: Arguments.kwargs
) -> Result:
    """Call a function in another thread; see `LookUp`.

    A server of databases that is reached and says nothing is not waited for; the thread is left to itself.

    Parameters
    ----------
    read : callable
    *arguments, **named
        Arguments of `read`.

    Returns
    -------
    object
        The result of `read`.

    Raises
    ------
    TimeoutError
        If it takes longer than `READING_SECONDS`.
    """
    with fail_after(READING_SECONDS):
        return await to_thread.run_sync(partial(read, *arguments, **named), abandon_on_cancel=True)


def look_up_for(urls: Iterable[str]) -> LookUp:
    """Choose how coroutines read single records from databases.

    Parameters
    ----------
    urls : iterable of str
        URLs of the databases. A file is read in less time than a switch to another thread takes; a server
        may take long, and must not block the event loop.

    Returns
    -------
    LookUp
    """
    if all(is_file(url) for url in urls):
        return read_inline
    return read_in_thread
