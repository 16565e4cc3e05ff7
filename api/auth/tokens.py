"""Bearer tokens. The database holds a digest of each; the token itself is shown once, when it is created."""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
from collections.abc import Callable, Sequence
from datetime import datetime, timedelta

from pydantic import BaseModel, ConfigDict
from rich.table import Table
from sqlalchemy import bindparam, exists, insert, select, update

from api.auth import TokenScope
from api.database.database_tables import TokenRow
from api.database.service_database import Database
from ensemble.errors import BadInput
from ensemble.timestamp import Timestamp, now

IDENTIFIER_BYTES = 6
SECRET_BYTES = 32  # as random as the digest is long: no salt and no slow hash are needed
USER_PATTERN = re.compile(r"[A-Za-z0-9._@-]{1,64}")
MAXIMUM_LENGTH = 200  # characters of a token; what follows is ignored
EMPTY_DIGEST = hashlib.sha256(b"").hexdigest()


class Token(BaseModel):
    """A token without its secret part.

    Attributes
    ----------
    id : str
        The first part of the token, which is not secret.
    user : str
    scope : TokenScope
    created, expires : datetime
    """

    model_config = ConfigDict(frozen=True, from_attributes=True)

    id: str
    user: str
    scope: TokenScope
    created: Timestamp
    expires: Timestamp


_COLUMNS = tuple(getattr(TokenRow, name) for name in Token.model_fields)
_VALID = TokenRow.revoked.is_(None)
_BY_IDENTIFIER = select(*_COLUMNS, TokenRow.digest).where(TokenRow.id == bindparam("identifier"), _VALID)
_EXPIRY = select(TokenRow.expires).where(TokenRow.id == bindparam("identifier"), _VALID)
_ANY = select(exists().select_from(TokenRow))


class Tokens:
    """The tokens of a service.

    Parameters
    ----------
    database : Database
    clock : callable
        Returns the present time.
    """

    def __init__(self, database: Database, clock: Callable[[], datetime] = now) -> None:
        self._database = database
        self._clock = clock

    def create(self, user: str, scope: TokenScope, lifetime: timedelta) -> str:
        """Create a token.

        Parameters
        ----------
        user : str
            1 to 64 letters, digits and ``. _ @ -``.
        scope : TokenScope
        lifetime : timedelta
            Time after which the token expires.

        Returns
        -------
        str
            The token. It cannot be read again.

        Raises
        ------
        BadInput
            If the name of the user is not allowed.
        """
        if USER_PATTERN.fullmatch(user) is None:
            raise BadInput(f"user: {user!r} — must be 1 to 64 letters, digits and . _ @ -")
        identifier, secret = secrets.token_hex(IDENTIFIER_BYTES), secrets.token_urlsafe(SECRET_BYTES)
        created = self._clock()
        token = Token(id=identifier, user=user, scope=scope, created=created, expires=created + lifetime)
        with self._database.begin() as connection:
            connection.execute(insert(TokenRow).values(**token.model_dump(), digest=_digest(secret)))
        return f"{identifier}.{secret}"

    def find(self, text: str) -> Token | None:
        """Return the token that a client sent.

        Parameters
        ----------
        text : str
            The whole token.

        Returns
        -------
        Token or None
            None if the token is unknown, expired or revoked.
        """
        identifier, _, secret = text[:MAXIMUM_LENGTH].partition(".")
        with self._database.connect() as connection:
            row = connection.execute(_BY_IDENTIFIER, {"identifier": identifier}).one_or_none()
        # The comparison takes the same time whether or not the token exists, and wherever digests differ.
        is_equal = hmac.compare_digest(_digest(secret), EMPTY_DIGEST if row is None else row.digest)
        if row is None or not is_equal or row.expires <= self._clock():
            return None
        return Token.model_validate(row)

    def is_valid(self, identifier: str) -> bool:
        """Tell whether a token is neither revoked nor expired.

        Parameters
        ----------
        identifier : str
            The `id` of the token.

        Returns
        -------
        bool
        """
        with self._database.connect() as connection:
            expires = connection.scalar(_EXPIRY, {"identifier": identifier})
        return expires is not None and expires > self._clock()

    def have_existed(self) -> bool:
        """Tell whether a token has ever been created, even if all of them have been revoked."""
        with self._database.connect() as connection:
            return bool(connection.scalar(_ANY))

    def all(self) -> list[Token]:
        """Return all tokens that were not revoked, expired ones included, the oldest first."""
        with self._database.connect() as connection:
            rows = connection.execute(select(*_COLUMNS).where(_VALID).order_by(TokenRow.created, TokenRow.id))
            return [Token.model_validate(row) for row in rows]

    def revoke(self, identifier: str) -> None:
        """Make a token invalid from now on.

        Parameters
        ----------
        identifier : str
            The `id` of the token.

        Raises
        ------
        BadInput
            If there is no such token.
        """
        revoked = update(TokenRow).where(TokenRow.id == identifier, _VALID).values(revoked=self._clock())
        with self._database.begin() as connection:
            changed = connection.execute(revoked).rowcount
        if not changed:
            raise BadInput(f"token: there is no token with the id {identifier!r}")


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()


def tokens_table(tokens: Sequence[Token]) -> Table:
    """Return a table of tokens for the terminal.

    Parameters
    ----------
    tokens : sequence of Token

    Returns
    -------
    Table
        One row for each token.
    """
    table = Table("id", "user", "scope", "created", "expires")
    for token in tokens:
        moments = (f"{moment:%Y-%m-%d %H:%M}" for moment in (token.created, token.expires))
        table.add_row(token.id, token.user, token.scope, *moments)
    return table
