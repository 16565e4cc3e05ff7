"""Runs on MPI ranks: groups of ranks, the dispatcher, and the study that they carry out."""
