"""The database of the service: SQLite in the store, or PostgreSQL by its URL."""
