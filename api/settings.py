"""What an operator may set, by environment variables such as ``ENSEMBLE_MAXIMUM_RANKS=8``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field
from pydantic_settings import BaseSettings, SettingsConfigDict

from ensemble.cli.main import DEFAULT_STORE
from ensemble.store.sql_database import Place, is_file, sqlite_url


def _rate(text: str) -> str:
    from limits import parse  # takes a while, and a worker has no rates

    parse(text)  # raises ValueError
    return text


Rate = Annotated[str, AfterValidator(_rate)]
JOBS_DATABASE = "jobs.sqlite"  # in the store, unless another database is named


class Settings(BaseSettings):
    """Where the service keeps things, and the limits that it holds its users to.

    Rates are written as the library `limits` reads them: ``100/second``, ``6000 per minute``.
    """

    model_config = SettingsConfigDict(env_prefix="ENSEMBLE_", frozen=True, extra="ignore")

    store: Path = DEFAULT_STORE
    database: str | None = None  # URL of a server, as `ensemble.store.sql_database` says

    maximum_ranks: int = Field(default_factory=lambda: os.cpu_count() or 1, ge=1)  # of a job
    maximum_seconds: float = Field(24 * 3600.0, gt=0)  # that a job may run
    maximum_jobs: int = Field(100, ge=1)  # of one user that are not finished
    maximum_cost: float = Field(1e9, gt=0)  # of a job: points × vesicles × time to simulate

    body_bytes: int = Field(1 << 18, ge=1)  # of a request
    body_seconds: float = Field(10.0, gt=0)  # in which the body of a request has to arrive
    header_bytes: int = Field(1 << 15, ge=1)
    header_seconds: float = Field(10.0, gt=0)
    connections: int = Field(1000, ge=1)  # at once; further ones are answered 503
    frame_values: int = Field(1_000_000, ge=1)  # numbers in one answer about frames

    request_rate: Rate = "6000/minute"  # of one user
    refusal_rate: Rate = "20/minute"  # bad tokens from one address, after which it is refused for a while

    event_seconds: float = Field(0.5, gt=0)  # between looks at a job that somebody listens to

    @property
    def database_url(self) -> str:
        """URL of the database of jobs and tokens: an SQLite file in the store unless one is set.

        A store that was made with a server for its catalog has them there, too.
        """
        if self.database is not None:
            return self.database
        store = self.store.resolve()
        catalog = Place.of(store).url
        return sqlite_url(store / JOBS_DATABASE) if is_file(catalog) else catalog
