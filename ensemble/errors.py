"""Errors that this package raises on purpose, with one base class."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class EnsembleError(Exception):
    """Base class of all errors of this package."""


class BadInput(EnsembleError):  # noqa: N818
    """The request cannot be carried out as given; the message names the field and what it allows.

    Raised before any work starts and before anything is written.
    """


class StoreError(EnsembleError):
    """Stored data are damaged or lost; the message says which and how."""


class OtherVersionError(StoreError):
    """A record that another version wrote and that this one cannot read."""


class StoreInputError(BadInput, ValueError):
    """The named store, run, boundary or filter does not exist or is not valid; the message names it."""


class NotStored(StoreInputError):  # noqa: N818
    """The store has no run or boundary with that key."""


class Interrupted(BaseException):
    """A signal asked this process to end.

    Parameters
    ----------
    number : int
        The signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.status = 128 + number


@contextmanager
def refusing() -> Iterator[None]:
    """Turn errors about unusable input (`ValueError`, `OSError`) into `BadInput`."""
    try:
        yield
    except (ValueError, OSError) as error:
        raise BadInput(str(error)) from error
