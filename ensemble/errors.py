"""What can go wrong before or beside a simulation, with one base class."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class EnsembleError(Exception):
    """Base of every error that this package raises on purpose."""


class BadInput(EnsembleError):  # noqa: N818
    """The request cannot be carried out as given; the message names the field and what it allows.

    Raised before any work starts and before anything is written.
    """


@contextmanager
def refusing() -> Iterator[None]:
    """Turn what the packages say about unusable input into `BadInput`."""
    try:
        yield
    except (ValueError, OSError) as error:
        raise BadInput(str(error)) from error
