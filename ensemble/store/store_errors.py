"""What can be wrong with a store, and with a request to it."""

from __future__ import annotations

from ensemble.errors import BadInput, EnsembleError


class StoreError(EnsembleError):
    """Stored data is damaged or lost; the message says which and how."""


class StoreInputError(BadInput, ValueError):
    """The named store, run or filter is none; the message names it."""


class NotStored(StoreInputError):  # noqa: N818
    """The store has no run or boundary of that key."""
