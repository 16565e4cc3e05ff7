"""Runs and boundaries of one store, copied into another."""

from __future__ import annotations

from typing import NamedTuple

from ensemble.store.store import Store


class Merged(NamedTuple):
    """How many runs and boundaries were copied, and how many of the runs were there already."""

    runs: int
    boundaries: int
    known_runs: int


def merge(source: Store, target: Store) -> Merged:
    """Copy all runs and boundaries of one store into another; of a boundary in both, the newer one stays.

    Parameters
    ----------
    source : Store
        Read only.
    target : Store
        Open to write.

    Returns
    -------
    Merged
        What was copied.

    Raises
    ------
    StoreError
        If a run of the source is damaged.  All runs before it are copied.
    """
    runs = known = boundaries = 0
    for summary in source.summaries():
        if target.contains(summary.key):
            known += 1
            continue
        target.save(source.load(summary.key), summary)
        runs += 1
    there = {boundary.study_key: boundary for boundary in target.boundaries()}
    for boundary in source.boundaries():
        other = there.get(boundary.study_key)
        if other is None or other.updated < boundary.updated:
            target.save_boundary(boundary)
            boundaries += 1
    return Merged(runs, boundaries, known)
