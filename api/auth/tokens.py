"""Bearer tokens.  Of each, the database holds a digest; the token itself is shown once, when it is made."""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
from collections.abc import Callable, Sequence
from datetime import datetime, timedelta

from pydantic import BaseModel, ConfigDict
from rich.table import Table
from sqlalchemy import bindparam, delete, insert, select

from api.auth.scope import Scope
from api.database.database_tables import TokenRow
from api.database.service_database import Database
from ensemble.errors import BadInput
from ensemble.timestamp import Timestamp, now

ID_BYTES = 6
SECRET_BYTES = 32  # as many as the digest has: it needs no salt and no slow hash
USER = re.compile(r"[A-Za-z0-9._@-]{1,64}")
LONGEST = 200  # of what is taken for a token at all
NOBODY = hashlib.sha256(b"").hexdigest()


class Token(BaseModel):
    """What is known of a token.  `id` is the part of it that is no secret."""

    model_config = ConfigDict(frozen=True, from_attributes=True)

    id: str
    user: str
    scope: Scope
    created: Timestamp
    expires: Timestamp


_SEEN = tuple(getattr(TokenRow, name) for name in Token.model_fields)
_SHOWN = select(*_SEEN, TokenRow.digest).where(TokenRow.id == bindparam("identifier"))


class Tokens:
    """The tokens of a service.

    Parameters
    ----------
    database : Database
    clock : callable
        The present.
    """

    def __init__(self, database: Database, clock: Callable[[], datetime] = now) -> None:
        self._database = database
        self._clock = clock

    def create(self, user: str, scope: Scope, lifetime: timedelta) -> str:
        """Make a token and return it; nobody can read it again.

        Raises
        ------
        BadInput
            If the name of the user is none.
        """
        if USER.fullmatch(user) is None:
            raise BadInput(f"user: {user!r} — must be 1 to 64 letters, digits and . _ @ -")
        identifier, secret = secrets.token_hex(ID_BYTES), secrets.token_urlsafe(SECRET_BYTES)
        created = self._clock()
        token = Token(id=identifier, user=user, scope=scope, created=created, expires=created + lifetime)
        with self._database.begin() as connection:
            connection.execute(insert(TokenRow).values(**token.model_dump(), digest=_digest(secret)))
        return f"{identifier}.{secret}"

    def find(self, text: str) -> Token | None:
        """Return what is known of a token that somebody shows; None if it is not valid."""
        identifier, _, secret = text[:LONGEST].partition(".")
        with self._database.connect() as connection:
            row = connection.execute(_SHOWN, {"identifier": identifier}).one_or_none()
        # One comparison whether or not there is such a token, and as long wherever the two differ.
        same = hmac.compare_digest(_digest(secret), NOBODY if row is None else row.digest)
        if row is None or not same or row.expires <= self._clock():
            return None
        return Token.model_validate(row)

    def all(self) -> list[Token]:
        """All tokens, also those that have expired; the oldest first."""
        with self._database.connect() as connection:
            rows = connection.execute(select(*_SEEN).order_by(TokenRow.created, TokenRow.id))
            return [Token.model_validate(row) for row in rows]

    def revoke(self, identifier: str) -> None:
        """Make a token invalid at once.

        Raises
        ------
        BadInput
            If there is none of this identifier.
        """
        with self._database.begin() as connection:
            removed = connection.execute(delete(TokenRow).where(TokenRow.id == identifier))
        if not removed.rowcount:
            raise BadInput(f"token: there is none with the id {identifier!r}")


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()


def tokens_table(tokens: Sequence[Token]) -> Table:
    """Tokens, one a row."""
    table = Table("id", "user", "scope", "created", "expires")
    for token in tokens:
        moments = (f"{moment:%Y-%m-%d %H:%M}" for moment in (token.created, token.expires))
        table.add_row(token.id, token.user, token.scope, *moments)
    return table
