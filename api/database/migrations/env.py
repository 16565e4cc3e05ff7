"""Run the migrations that a database lacks, on the connection of `api.database.service_database`."""

from __future__ import annotations

from alembic import context

from api.database.database_tables import ServiceTable

# SQLite changes a table by copying it. Other databases use ALTER statements for the same migrations.
context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=ServiceTable.metadata,
    render_as_batch=True,
)
with context.begin_transaction():
    context.run_migrations()
