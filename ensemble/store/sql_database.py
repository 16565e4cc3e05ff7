"""Databases of a store: an SQLite file each, unless the store was made with the URL of a server.

The environment variable ``ENSEMBLE_DATABASE``, such as ``postgresql+psycopg://user@host/name``, names the
server when a store is made.  The store keeps it (in a file that its owner alone may read, as there may be a
password in it), so nobody who opens the store later has to know, or can miss, where its catalog is.  Several
stores may share a database: the catalog of each is in a schema of its own.
"""

from __future__ import annotations

import secrets
from pathlib import Path
from typing import Self

from pydantic import BaseModel, ConfigDict
from pydantic_settings import BaseSettings, SettingsConfigDict
from sqlalchemy import URL, Engine, create_engine, event, make_url
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.exc import ArgumentError, DBAPIError, NoSuchModuleError
from sqlalchemy.pool import ConnectionPoolEntry

from ensemble.disk import flush, replacing

CATALOG = "catalog.sqlite"
PLACE = "catalog.json"
BUSY_SECONDS = 60

# What is raised where a URL is none, its driver is missing, or the database does not answer.
UNUSABLE = (ArgumentError, NoSuchModuleError, ModuleNotFoundError, DBAPIError)


class DatabaseSettings(BaseSettings):
    """The server for the databases of stores that are made; files in the store if it is left out."""

    model_config = SettingsConfigDict(env_prefix="ENSEMBLE_", frozen=True, extra="ignore")

    database: str | None = None


class Place(BaseModel):
    """Where the catalog of a store is: a schema of a database, which only a server has, and its URL."""

    model_config = ConfigDict(frozen=True)

    url: str
    schema_name: str | None

    @classmethod
    def of(cls, store: Path) -> Self:
        """Read where a store, or what is to become one, has its catalog."""
        kept = store / PLACE
        if kept.exists():
            return cls.model_validate_json(kept.read_bytes())
        return cls(url=sqlite_url(store / CATALOG), schema_name=None)

    @classmethod
    def choose(cls, store: Path) -> Self:
        """Decide where a new store has its catalog."""
        url = DatabaseSettings().database
        if url is None or is_file(url) or (store / PLACE).exists():
            return cls.of(store)
        return cls(url=url, schema_name=f"store_{secrets.token_hex(8)}")

    def keep(self, store: Path) -> None:
        """Have a new store find its catalog again."""
        if self != self.of(store):
            _write_secretly(store / PLACE, self.model_dump_json())


def _write_secretly(path: Path, text: str) -> None:
    """Write a file that its owner alone may read, whole or not at all."""
    with replacing(path) as unfinished:
        unfinished.touch(mode=0o600)
        unfinished.write_text(text, encoding="utf-8")
        flush(unfinished)
    flush(path.parent)


def sqlite_url(path: Path) -> str:
    """URL of an SQLite file."""
    return URL.create("sqlite", database=str(path)).render_as_string()


def is_file(url: str) -> bool:
    """Tell whether a URL is that of a file, which every look-up finds at once, or of a server."""
    return make_url(url).get_backend_name() == "sqlite"


def engine(url: str) -> Engine:
    """Make what connects to a database; each commit on it outlives a power failure."""
    if not is_file(url):
        return create_engine(url, pool_pre_ping=True)
    made = create_engine(url, connect_args={"timeout": BUSY_SECONDS})
    event.listen(made, "connect", _durable)
    return made


def _durable(connection: DBAPIConnection, _: ConnectionPoolEntry) -> None:
    cursor = connection.cursor()
    cursor.execute("PRAGMA journal_mode=WAL")  # readers wait for no writer
    cursor.execute("PRAGMA synchronous=FULL")  # an acknowledged commit outlives a power failure
    cursor.close()


def reason(error: BaseException) -> str:
    """Say on one line why a database cannot be used."""
    return str(getattr(error, "orig", None) or error).splitlines()[0]
