"""Runs the steps that a database lacks, on the connection that `api.database.service_database` gives."""

from __future__ import annotations

from alembic import context

from api.database.database_tables import ServiceTable

# SQLite changes a table by copying it; elsewhere the same steps are plain ALTER statements.
context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=ServiceTable.metadata,
    render_as_batch=True,
)
with context.begin_transaction():
    context.run_migrations()
