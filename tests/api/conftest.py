"""Fixtures: stores, databases, queues, and clients of services."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest

from api.database.service_database import Database
from api.jobs.job_queue import Jobs
from api.settings import Settings
from ensemble.store import Store
from tests import postgresql
from tests.api.servers import client_of
from tests.api.stores import fill


@pytest.fixture
def store(tmp_path: Path) -> Path:
    """An empty store."""
    path = tmp_path / "store"
    Store.open(path).close()
    return path


@pytest.fixture(params=["sqlite", "postgresql"])
def database_url(request: pytest.FixtureRequest, store: Path) -> str:
    """URL of an empty database, on SQLite and on PostgreSQL."""
    if request.param == "sqlite":
        return Settings(store=store).database_url
    server: postgresql.Server = request.getfixturevalue("postgresql_server")
    return server.new_database()


@pytest.fixture
def database(database_url: str, store: Path) -> Iterator[Database]:
    """A database with its tables."""
    with Database.open(database_url, store) as opened:
        yield opened


@pytest.fixture
def jobs(database: Database, store: Path) -> Jobs:
    """An empty queue."""
    return Jobs(database, store)


@pytest.fixture(scope="session")
def filled_store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with runs and a boundary; tests only read it."""
    return fill(tmp_path_factory.mktemp("filled") / "store")


@pytest.fixture(scope="session")
def reading(filled_store: Path) -> Iterator[httpx2.Client]:
    """A client of a service of the filled store; tests only read."""
    with client_of(filled_store) as client:
        yield client


@pytest.fixture
def submitting(store: Path) -> Iterator[httpx2.Client]:
    """A client of a service of an empty store without workers."""
    with client_of(store) as client:
        yield client
