"""What can go wrong before or beside a simulation, with one base class."""

from __future__ import annotations


class EnsembleError(Exception):
    """Base of every error that this package raises on purpose."""


class BadInput(EnsembleError):  # noqa: N818
    """The request cannot be carried out as given; the message names the field and what it allows.

    Raised before any work starts and before anything is written.
    """
