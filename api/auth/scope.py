"""What a token allows."""

from __future__ import annotations

from enum import StrEnum


class Scope(StrEnum):
    """To read; also to submit jobs and dismiss one's own; or everything."""

    READ = "read"
    SUBMIT = "submit"
    ADMIN = "admin"

    def includes(self, other: Scope) -> bool:
        """Whether this one allows all that the other does."""
        return _RANKS[self] >= _RANKS[other]


_RANKS = {scope: rank for rank, scope in enumerate(Scope)}
