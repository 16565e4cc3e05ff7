"""Keep tokens that have been revoked: a service that has ever had a token needs one."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the time at which a token was revoked."""
    with op.batch_alter_table("tokens") as tokens:
        tokens.add_column(sa.Column("revoked", sa.String(32), nullable=True))


def downgrade() -> None:
    """Forget the tokens that were revoked, which would be valid again."""
    op.execute("DELETE FROM tokens WHERE revoked IS NOT NULL")
    with op.batch_alter_table("tokens") as tokens:
        tokens.drop_column("revoked")
