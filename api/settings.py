"""Settings of the service, from environment variables such as ``ENSEMBLE_MAXIMUM_RANKS=8``."""

from __future__ import annotations

import os
from ipaddress import ip_network
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field
from pydantic_settings import BaseSettings, SettingsConfigDict

from ensemble.config.defaults import DEFAULT_STORE
from ensemble.store.sql_database import Place, is_file, sqlite_url


def _parsable_rate(text: str) -> str:
    from limits import parse  # slow to import, and a worker has no rates

    parse(text)  # raises ValueError
    return text


def _addresses(text: str) -> tuple[str, ...]:
    """Return the addresses and networks in a list with commas; ValueError if one is none."""
    addresses = tuple(part.strip() for part in text.split(",") if part.strip())
    for address in addresses:
        ip_network(address)
    return addresses


def _parsable_addresses(text: str) -> str:
    _addresses(text)
    return text


def _physical_memory() -> int:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


Rate = Annotated[str, AfterValidator(_parsable_rate)]
Addresses = Annotated[str, AfterValidator(_parsable_addresses)]
JOBS_DATABASE = "jobs.sqlite"  # in the store, unless a database server is set


class Settings(BaseSettings):
    """Where the service keeps its data, and the limits for its users.

    The library `limits` defines how rates are written: ``100/second``, ``6000 per minute``. The table in
    ``api/README.md`` describes each setting.
    """

    model_config = SettingsConfigDict(env_prefix="ENSEMBLE_", frozen=True, extra="ignore")

    store: Path = Field(DEFAULT_STORE, description="Directory of the store: the option --store.")
    database: str | None = Field(
        None, description="URL of a PostgreSQL database for jobs, tokens and the catalogs of new stores."
    )

    maximum_ranks: int = Field(
        default_factory=lambda: os.cpu_count() or 1, ge=1, description="Largest number of ranks of a job."
    )
    maximum_seconds: float = Field(
        24 * 3600.0, gt=0, description="Longest time limit of one attempt of a job, in seconds."
    )
    maximum_jobs: int = Field(100, ge=1, description="Unfinished jobs that one user may have.")
    maximum_cost: float = Field(
        1e9, gt=0, description="Largest cost of a job: points × vesicles × time to simulate."
    )
    maximum_recorded: float = Field(
        1e9, gt=0, description="Most numbers that a job may record, over all runs; each takes up to 8 bytes."
    )

    maximum_memory: int = Field(
        default_factory=_physical_memory,
        ge=1 << 29,
        description="Most memory of a job, in bytes, over all its processes; each gets an equal part.",
    )

    launcher: Literal["mpirun", "slurm"] = Field(
        "mpirun",
        description="What starts the ranks of a job: `mpirun` here, or `slurm`, which submits each job to a "
        "cluster.",
    )
    slurm_options: str = Field(
        "", description="Further options of `sbatch`, such as `--partition=long --mem-per-cpu=2G`."
    )

    body_bytes: int = Field(1 << 18, ge=1, description="Largest body of a request, in bytes.")
    body_seconds: float = Field(
        10.0, gt=0, description="Time within which the body of a request must arrive, in seconds."
    )
    header_bytes: int = Field(1 << 15, ge=1, description="Largest request line with headers, in bytes.")
    header_seconds: float = Field(
        10.0, gt=0, description="Time within which request line and headers must arrive, in seconds."
    )
    answer_seconds: float = Field(
        30.0,
        gt=0,
        description="Time within which a client must read each 64 kB of an answer, in seconds.",
    )
    idle_seconds: float = Field(
        5.0, gt=0, description="Time for which a connection stays open without a request, in seconds."
    )
    connections: int = Field(
        1000, ge=1, description="Simultaneous connections; further ones are answered with 503."
    )
    frame_values: int = Field(
        1_000_000,
        ge=1,
        description="Largest number of values in one answer about diagnostics or recorded states.",
    )

    request_rate: Rate = Field("6000/minute", description="Largest rate of requests of one user.")
    submission_rate: Rate = Field(
        "2000/hour", description="Largest rate of submissions of one user, dismissed ones included."
    )
    refusal_rate: Rate = Field(
        "20/minute",
        description="Largest rate of invalid tokens from one address; further ones are answered with 429.",
    )
    trusted_proxies: Addresses = Field(
        "",
        description="Addresses or networks of proxies, with commas between them; their `X-Forwarded-For` "
        "names the client.",
    )

    event_streams: int = Field(
        100,
        ge=1,
        description="Streams of events that one user may have open; further ones are answered with 429.",
    )
    event_seconds: float = Field(
        0.5,
        gt=0,
        description="Interval between readings of a job whose events a client listens to, in seconds.",
    )

    @property
    def proxies(self) -> tuple[str, ...]:
        """The trusted proxies by their addresses and networks."""
        return _addresses(self.trusted_proxies)

    @property
    def database_url(self) -> str:
        """URL of the database of jobs and tokens.

        It is the one that is set, else the database server that the store has its catalog on, else an SQLite
        file in the store.

        Returns
        -------
        str
        """
        if self.database is not None:
            return self.database
        store = self.store.resolve()
        catalog = Place.of(store).url
        return sqlite_url(store / JOBS_DATABASE) if is_file(catalog) else catalog
