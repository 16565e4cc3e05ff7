"""Runs, branches and boundaries of one store, copied into another."""

from __future__ import annotations

from typing import NamedTuple

from ensemble.store.listing import Listing
from ensemble.store.reading import validated
from ensemble.store.run_record import RunSummary
from ensemble.store.store import Store


class Merged(NamedTuple):
    """How many runs, boundaries and branches were copied, and how many of the runs were there already."""

    runs: int
    boundaries: int
    branches: int
    known_runs: int


def merge(source: Store, target: Store) -> Merged:
    """Copy all that one store has into another; of a boundary in both, the newer one stays.

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
        If a run or a branch of the source is damaged.  Everything before it is copied.
    """
    runs = known = 0
    for record in source.run_records(Listing(sort="created")):
        if target.contains(record.key):
            known += 1
            continue
        target.save(source.load(record.key), validated(RunSummary, "run", record))
        runs += 1
    return Merged(runs, _merge_boundaries(source, target), _merge_branches(source, target), known)


def _merge_boundaries(source: Store, target: Store) -> int:
    copied = 0
    there = {boundary.study_key: boundary for boundary in target.boundaries()}
    for boundary in source.boundaries():
        other = there.get(boundary.study_key)
        if other is None or other.updated < boundary.updated:
            target.save_boundary(boundary)
            target.save_boundary_arrays(boundary)
            copied += 1
    return copied


def _merge_branches(source: Store, target: Store) -> int:
    missing = [key for key in source.branches.keys() if not target.branches.contains(key)]  # noqa: SIM118
    for key in missing:
        target.copy_branch(key, source)
    return len(missing)
