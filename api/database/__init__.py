"""The database of jobs and tokens: SQLite in the store, or PostgreSQL by its URL."""
