"""Databases of a store: an SQLite file each, unless the store was made with the URL of a server.

The environment variable ``ENSEMBLE_DATABASE``, such as ``postgresql+psycopg://user@host/name``, names the
server when a store is made.  The store keeps it in a file that only its owner may read, because the URL may
hold a password.  So nobody who opens the store later has to know where its catalog is.  If the variable names
a server then, only the schema is taken from the file: roles, passwords and hosts may change.  Several stores
may share a database: the catalog of each is in a schema of its own.
"""

from __future__ import annotations

import secrets
import shutil
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from contextvars import ContextVar
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, Self
from urllib.parse import quote

from pydantic import BaseModel, ConfigDict
from pydantic_settings import BaseSettings, SettingsConfigDict
from sqlalchemy import URL, Connection, Engine, create_engine, event, make_url
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.exc import (
    ArgumentError,
    DBAPIError,
    DisconnectionError,
    NoSuchModuleError,
    OperationalError,
)
from sqlalchemy.exc import TimeoutError as NoConnectionLeft
from sqlalchemy.pool import ConnectionPoolEntry, QueuePool

from ensemble.disk import flush, replacing

CATALOG = "catalog.sqlite"
PLACE = "catalog.json"
BUSY_SECONDS = 60

# Of a server: a host that drops packets must not let a request wait for minutes, as it does by default.
POOL_SECONDS = 10  # for a connection of the pool to become free
CONNECTING = {
    "connect_timeout": 5,
    "tcp_user_timeout": 10_000,  # milliseconds for which what was sent may stay without an answer of the host
    "keepalives_idle": 5,
    "keepalives_interval": 2,
    "keepalives_count": 3,
}

Journal = Literal["wal", "delete"]

_busy_seconds = ContextVar("busy_seconds", default=BUSY_SECONDS)  # for which a locked file is waited for

# What is raised where a URL is invalid, its driver is missing, or the database does not answer.
UNUSABLE = (ArgumentError, NoSuchModuleError, ModuleNotFoundError, DBAPIError, NoConnectionLeft)


class DatabaseSettings(BaseSettings):
    """The server for the databases of stores that are made; files in the store if it is left out."""

    model_config = SettingsConfigDict(env_prefix="ENSEMBLE_", frozen=True, extra="ignore")

    database: str | None = None


class Place(BaseModel):
    """Where the catalog of a store is.

    Attributes
    ----------
    url : str
        Of the database.
    schema_name : str or None
        Schema in the database of a server; None in a file.
    """

    model_config = ConfigDict(frozen=True)

    url: str
    schema_name: str | None

    @classmethod
    def of(cls, store: Path) -> Self:
        """Read where a store, or a directory that becomes one, has its catalog.

        Parameters
        ----------
        store : Path
            Directory of the store.

        Returns
        -------
        Place
        """
        kept = store / PLACE
        if kept.exists():
            place = cls.model_validate_json(kept.read_bytes())
            url = DatabaseSettings().database
            if url is None or is_file(url) or place.schema_name is None:
                return place
            return cls(url=url, schema_name=place.schema_name)  # a role or a password may have changed
        return cls(url=sqlite_url(store / CATALOG), schema_name=None)

    @classmethod
    def choose(cls, store: Path) -> Self:
        """Decide where a new store has its catalog.

        Parameters
        ----------
        store : Path
            Directory of the store.

        Returns
        -------
        Place
        """
        url = DatabaseSettings().database
        if url is None or is_file(url) or (store / PLACE).exists():
            return cls.of(store)
        return cls(url=url, schema_name=f"store_{secrets.token_hex(8)}")

    def keep(self, store: Path) -> None:
        """Write down where a new store has its catalog.

        Parameters
        ----------
        store : Path
            Directory of the store.
        """
        if self != self.of(store):
            _write_secretly(store / PLACE, self.model_dump_json())


def _write_secretly(path: Path, text: str) -> None:
    """Write a file that only its owner may read, whole or not at all."""
    with replacing(path) as unfinished:
        unfinished.touch(mode=0o600)
        unfinished.write_text(text, encoding="utf-8")
        flush(unfinished)
    flush(path.parent)


def sqlite_url(path: Path) -> str:
    """Return the URL of an SQLite file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    str
    """
    return URL.create("sqlite", database=str(path)).render_as_string()


def is_file(url: str) -> bool:
    """Tell whether a URL is that of an SQLite file, or of a server.

    Parameters
    ----------
    url : str

    Returns
    -------
    bool
    """
    return make_url(url).get_backend_name() == "sqlite"


def engine(url: str, journal: Journal = "wal") -> Engine:
    """Make what connects to a database; each commit on it outlives a power failure.

    Parameters
    ----------
    url : str
        Of an SQLite file or a server.
    journal : str
        How an SQLite file keeps commits whole.  With ``"wal"`` readers wait for no writer, but the file must
        be used from one machine only, and readers leave files beside it.  With ``"delete"`` neither holds.

    Returns
    -------
    Engine
    """
    if not is_file(url):
        return _server_engine(url)
    made = create_engine(url)
    event.listen(made, "connect", _set_patience)
    event.listen(made, "checkout", _set_patience)
    event.listen(made, "connect", partial(_durable, journal))
    path = Path(make_url(url).database or "")
    event.listen(made, "connect", partial(_note_file, path))
    event.listen(made, "checkout", partial(_require_same_file, path))
    return made


def _server_engine(url: str) -> Engine:
    """Make what connects to a server.  Options in the URL come before those here."""
    address = make_url(url)
    is_postgresql = address.get_backend_name() == "postgresql"
    options = {name: value for name, value in CONNECTING.items() if name not in address.query}
    made = create_engine(
        address,
        pool_pre_ping=True,
        pool_timeout=POOL_SECONDS,
        connect_args=options if is_postgresql else {},
    )
    if address.drivername == "postgresql+psycopg":
        from ensemble.store.silent_servers import connect  # the driver is an extra

        event.listen(made, "do_connect", connect)
    return made


@contextmanager
def transaction(engine: Engine) -> Iterator[Connection]:
    """Open a transaction: durable when the block ends, rolled back if the block raises.

    Parameters
    ----------
    engine : Engine

    Yields
    ------
    Connection

    Raises
    ------
    sqlalchemy.exc.OperationalError
        If an SQLite file was moved or deleted in the meantime, and what was committed with it.
    """
    with engine.begin() as connection:
        used = connection.info.get("file")
        yield connection
    path = engine.url.database
    if used is not None and path and _identity(Path(path)) != used:
        raise _missing(Path(path))


def _missing(path: Path) -> OperationalError:
    return OperationalError(None, None, FileNotFoundError(f"{path.name} has been moved or deleted"))


def _note_file(path: Path, _: DBAPIConnection, record: ConnectionPoolEntry) -> None:
    record.info["file"] = _identity(path)


def _require_same_file(path: Path, _: DBAPIConnection, record: ConnectionPoolEntry, __: object) -> None:
    """Refuse a connection to a file that is no longer in its place: what it took would be lost with it."""
    present = _identity(path)
    if present is None:
        raise _missing(path)
    if present != record.info["file"]:
        raise DisconnectionError  # the pool connects to the one that is there now


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def reading_engine(url: str) -> Engine:
    """Make what reads a database and changes nothing: no file appears beside an SQLite file.

    It works where the file, its directory or the whole file system is read-only.

    Parameters
    ----------
    url : str
        Of an SQLite file or a server.

    Returns
    -------
    Engine
    """
    path = make_url(url).database if is_file(url) else None
    if path is None:
        return _server_engine(url)
    return create_engine("sqlite://", creator=partial(_connect_to_read, Path(path)), poolclass=QueuePool)


def _connect_to_read(path: Path) -> sqlite3.Connection:
    def connect(file: Path, option: str) -> sqlite3.Connection:
        address = f"file:{quote(str(file))}?{option}"
        connection = sqlite3.connect(address, uri=True, timeout=BUSY_SECONDS, check_same_thread=False)
        connection.execute("SELECT count(*) FROM sqlite_master")  # opens the file
        return connection

    if _in_wal_mode(path):
        log = path.with_name(path.name + "-wal")
        if not log.exists() or log.stat().st_size == 0:
            return connect(path, "immutable=1")
        return _connect_to_copy(path, connect)
    try:
        return connect(path, "mode=ro")
    except sqlite3.OperationalError:
        # A commit was cut short, and undoing it needs a file that can be written.
        if not path.with_name(path.name + "-journal").exists():
            raise
        return _connect_to_copy(path, connect)


def _connect_to_copy(path: Path, connect: Callable[[Path, str], sqlite3.Connection]) -> sqlite3.Connection:
    """Open a copy of the file and of what a writer left beside it, and forget the copy at once."""
    with TemporaryDirectory(prefix="ensemble-catalog-") as directory:
        for suffix in ("", "-wal", "-journal"):
            source = path.with_name(path.name + suffix)
            if source.exists():
                shutil.copyfile(source, Path(directory, path.name + suffix))
        with closing(connect(Path(directory, path.name), "mode=rw")) as copy:
            memory = sqlite3.connect(":memory:", check_same_thread=False)
            copy.backup(memory)
    return memory


def _in_wal_mode(path: Path) -> bool:
    """Tell from its header whether readers of an SQLite file need a write-ahead log."""
    with path.open("rb") as file:
        return file.read(20)[18:20] == b"\x02\x02"


def _set_patience(connection: DBAPIConnection, record: ConnectionPoolEntry, *_: object) -> None:
    seconds = _busy_seconds.get()
    if record.info.get("busy seconds") != seconds:
        cursor = connection.cursor()
        cursor.execute(f"PRAGMA busy_timeout={1000 * seconds}")
        cursor.close()
        record.info["busy seconds"] = seconds


@contextmanager
def without_waiting() -> Iterator[None]:
    """Let connections to an SQLite file fail at once if it is locked, as `is_locked` tells."""
    token = _busy_seconds.set(0)
    try:
        yield
    finally:
        _busy_seconds.reset(token)


def is_locked(error: OperationalError) -> bool:
    """Tell whether an SQLite file could not be used because another process writes to it.

    Parameters
    ----------
    error : OperationalError

    Returns
    -------
    bool
    """
    code = getattr(error.orig, "sqlite_errorcode", sqlite3.SQLITE_OK)
    return bool(code & 0xFF == sqlite3.SQLITE_BUSY)  # its other bits are details


def _durable(journal: Journal, connection: DBAPIConnection, _: ConnectionPoolEntry) -> None:
    cursor = connection.cursor()
    cursor.execute(f"PRAGMA journal_mode={journal}")
    cursor.execute("PRAGMA synchronous=FULL")  # an acknowledged commit outlives a power failure
    cursor.close()


def reason(error: BaseException) -> str:
    """Say on one line why a database cannot be used.

    Parameters
    ----------
    error : exception

    Returns
    -------
    str
    """
    lines = str(getattr(error, "orig", None) or error).splitlines()
    return lines[0] if lines else type(error).__name__  # a TimeoutError says nothing more
