"""The tables of the service's database."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import JSON, Dialect, Index, MetaData, String, TypeDecorator, UniqueConstraint
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

from ensemble.timestamp import timestamp_text


class Moment(TypeDecorator[datetime]):
    """A point in time as text, so that every database keeps it whole and orders it as time does."""

    impl = String(32)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> str | None:
        """Write it."""
        return None if value is None else timestamp_text(value)

    def process_result_value(self, value: str | None, dialect: Dialect) -> datetime | None:
        """Read it."""
        return None if value is None else datetime.fromisoformat(value)


class ServiceTable(DeclarativeBase):
    """Base of the tables."""

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

    `number` puts jobs in the order of their acceptance; `id` is how others name them.  `fingerprint` is that
    of the request which brought its idempotency key.  `attempts` is the fencing token of the worker that
    holds the lease.
    """

    __tablename__ = "jobs"
    __table_args__ = (
        UniqueConstraint("id"),
        UniqueConstraint("owner", "idempotency_key"),
        Index(None, "owner", "number"),
        Index(None, "status", "number"),
        Index(None, "status", "owner", "number"),
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
    created: Mapped[datetime]
    started: Mapped[datetime | None]
    finished: Mapped[datetime | None]
    updated: Mapped[datetime]


class TokenRow(ServiceTable):
    """A bearer token: who holds it, what it allows and until when; of its secret part only a digest."""

    __tablename__ = "tokens"

    id: Mapped[str] = mapped_column(primary_key=True)
    user: Mapped[str]
    scope: Mapped[str]
    digest: Mapped[str]
    created: Mapped[datetime]
    expires: Mapped[datetime]
