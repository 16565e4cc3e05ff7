"""Boundaries between outcomes: their searches, schedule on MPI ranks, store, figures and command line."""
