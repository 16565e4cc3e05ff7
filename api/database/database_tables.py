"""The tables of the service's database."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import JSON, Dialect, Index, MetaData, String, TypeDecorator, UniqueConstraint
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

from ensemble.timestamp import timestamp_text


class Moment(TypeDecorator[datetime]):
    """A point in time as text in ISO 8601.

    No database rounds it, and the order of the texts is that of the times.
    """

    impl = String(32)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> str | None:
        """Return the text of a time; see `TypeDecorator`.

        Parameters
        ----------
        value : datetime or None
        dialect : Dialect

        Returns
        -------
        str or None
        """
        return None if value is None else timestamp_text(value)

    def process_result_value(self, value: str | None, dialect: Dialect) -> datetime | None:
        """Return the time of a text; see `TypeDecorator`.

        Parameters
        ----------
        value : str or None
        dialect : Dialect

        Returns
        -------
        datetime or None
        """
        return None if value is None else datetime.fromisoformat(value)


class ServiceTable(DeclarativeBase):
    """Base class of the tables."""

    metadata = MetaData(
        naming_convention={
            "ix": "ix_%(table_name)s_%(column_0_N_name)s",
            "uq": "uq_%(table_name)s_%(column_0_N_name)s",
            "pk": "pk_%(table_name)s",
        }
    )
    type_annotation_map = {dict[str, Any]: JSON, datetime: Moment}  # noqa: RUF012


class JobRow(ServiceTable):
    """A job.

    Most columns are fields of `api.jobs.job.Job`. The others:

    Attributes
    ----------
    number : int
        Orders jobs by their acceptance.
    document : dict
        The study or the scene, with all fields.
    idempotency_key : str or None
        Key that the client sent with the submission.
    fingerprint : str
        Digest of the submission; another one with the same idempotency key is refused.
    attempts : int
        Number of attempts so far; the fencing token of the worker that holds the lease.
    worker : str or None
        Name of that worker.
    expires : datetime or None
        End of the lease.
    reached : float
        How far it has come, on the scale of `ensemble.display.progress_line.ProgressLine`.
    crashes : int
        Number of attempts that have ended without an answer since it last came further.
    retry : datetime or None
        When it may be tried again; None: now.
    """

    __tablename__ = "jobs"
    __table_args__ = (
        UniqueConstraint("id"),
        UniqueConstraint("owner", "idempotency_key"),
        Index(None, "owner", "number"),
        Index(None, "status", "number"),
        Index(None, "status", "owner", "number", "retry"),
        {"sqlite_autoincrement": True},
    )

    number: Mapped[int] = mapped_column(primary_key=True)
    id: Mapped[str]
    owner: Mapped[str]
    kind: Mapped[str]
    name: Mapped[str]
    key: Mapped[str]
    document: Mapped[dict[str, Any]]
    ranks: Mapped[int]
    seconds: Mapped[float]
    idempotency_key: Mapped[str | None]
    fingerprint: Mapped[str]
    status: Mapped[str]
    progress: Mapped[int]
    message: Mapped[str]
    attempts: Mapped[int]
    worker: Mapped[str | None]
    expires: Mapped[datetime | None]
    reached: Mapped[float] = mapped_column(server_default="0")
    crashes: Mapped[int] = mapped_column(server_default="0")
    retry: Mapped[datetime | None]
    created: Mapped[datetime]
    started: Mapped[datetime | None]
    finished: Mapped[datetime | None]
    updated: Mapped[datetime]


class TokenRow(ServiceTable):
    """A bearer token: its user, scope and lifetime, and a digest of its secret part.

    Tokens that were revoked stay: a service that has ever had a token needs one.
    """

    __tablename__ = "tokens"

    id: Mapped[str] = mapped_column(primary_key=True)
    user: Mapped[str]
    scope: Mapped[str]
    digest: Mapped[str]
    created: Mapped[datetime]
    expires: Mapped[datetime]
    revoked: Mapped[datetime | None]
