"""Authentication: tokens, their scopes, and who makes a request.

The scopes are defined here because the command line, which must start quickly, needs nothing else of it.
"""

from __future__ import annotations

from enum import StrEnum


class TokenScope(StrEnum):
    """What a token allows: to read; to submit jobs as well; to dismiss the jobs of others as well."""

    READ = "read"
    SUBMIT = "submit"
    ADMIN = "admin"

    def includes(self, other: TokenScope) -> bool:
        """Tell whether this scope allows everything that another one does.

        Parameters
        ----------
        other : TokenScope

        Returns
        -------
        bool
        """
        return _SCOPE_LEVELS[self] >= _SCOPE_LEVELS[other]


_SCOPE_LEVELS = {scope: level for level, scope in enumerate(TokenScope)}
