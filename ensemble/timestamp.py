"""Points in time as they are stored: UTC, and text whose alphabetical order is the order in time."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated

from pydantic import AfterValidator, PlainSerializer


def _in_utc(moment: datetime) -> datetime:
    return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)


def timestamp_text(moment: datetime) -> str:
    """Return a moment as text: ISO 8601 in UTC, microseconds always written.

    Parameters
    ----------
    moment : datetime
        In UTC if it has no time zone.

    Returns
    -------
    str
    """
    return _in_utc(moment).isoformat(timespec="microseconds")


Timestamp = Annotated[
    datetime,
    AfterValidator(_in_utc),
    PlainSerializer(timestamp_text, return_type=str, when_used="json"),
]


def now() -> datetime:
    """Return the present, in UTC."""
    return datetime.now(UTC)
