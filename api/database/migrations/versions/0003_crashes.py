"""Count the attempts of a job that ended without an answer, and put the next one off."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add how far a job has come, how often it has crashed there, and when it may be tried again."""
    # SQLite adds columns in place; a copy of the table would lose the order of numbers that were used.
    op.add_column("jobs", sa.Column("reached", sa.Double(), nullable=False, server_default="0"))
    op.add_column("jobs", sa.Column("crashes", sa.Integer(), nullable=False, server_default="0"))
    op.add_column("jobs", sa.Column("retry", sa.String(32), nullable=True))
    op.drop_index("ix_jobs_status_owner_number", "jobs")
    op.create_index("ix_jobs_status_owner_number_retry", "jobs", ["status", "owner", "number", "retry"])


def downgrade() -> None:
    """Forget them."""
    op.drop_index("ix_jobs_status_owner_number_retry", "jobs")
    op.create_index("ix_jobs_status_owner_number", "jobs", ["status", "owner", "number"])
    for name in ("retry", "crashes", "reached"):
        op.drop_column("jobs", name)
