"""Errors that this package raises on purpose, with one base class."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from typing import ClassVar

# Of a job that was asked to end and has kept what it was doing: the same command goes on (EX_TEMPFAIL).
SUSPENDED_STATUS = 75

# What is answered where a disk, a quota or the largest size of a file is reached.
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


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


class UnfinishedRunError(StoreError):
    """What is kept of a run that is not done cannot be used; the message says what to do, or what follows."""


class StoreInputError(BadInput, ValueError):
    """The named store, run, boundary or filter does not exist or is not valid; the message names it."""


class NotStored(StoreInputError):  # noqa: N818
    """The store has no run or boundary with that key."""


class Interrupted(BaseException):
    """A signal asked this process to end.

    Compiled code and libraries that this exception passes through may turn it into errors of their own, so
    the latest one is kept.

    Parameters
    ----------
    status : int
        With which the process ends: 128 and the number of the signal that ended it at once, or
        `SUSPENDED_STATUS`.
    """

    latest: ClassVar[Interrupted | None] = None

    def __init__(self, status: int) -> None:
        super().__init__(status)
        self.status = status
        Interrupted.latest = self


@contextmanager
def refusing() -> Iterator[None]:
    """Turn errors about unusable input (`ValueError`, `OSError`) into `BadInput`.

    A disk that is full is no matter of the input.
    """
    try:
        yield
    except (ValueError, OSError) as error:
        if getattr(error, "errno", None) in FULL:
            raise
        raise BadInput(str(error)) from error


def told_in_a_line(error: BaseException) -> str | None:
    """Say in one line what is wrong with the machine, the store or its database.

    Parameters
    ----------
    error : exception
        That ended a command.

    Returns
    -------
    str or None
        None for any other error, which is one of this package and shown in full.
    """
    if isinstance(error, MemoryError):  # first of all: nothing can be imported any more
        return f"there is not enough memory ({str(error) or 'for a small object'})"

    from sqlalchemy.exc import DBAPIError

    if isinstance(error, DBAPIError):
        return f"the database cannot be used ({str(error.orig).splitlines()[0]})"
    if isinstance(error, EnsembleError | OSError):
        return " ".join(str(error).split())  # HDF5 breaks its lines
    return None
