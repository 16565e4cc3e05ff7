"""Runs, branches, boundaries and maps of one store, copied into another."""

from __future__ import annotations

from typing import NamedTuple

from ensemble.store.listing import Listing
from ensemble.store.reading import validated
from ensemble.store.run_record import RunSummary
from ensemble.store.store import Store


class Merged(NamedTuple):
    """How many runs, boundaries, branches and maps were copied, and how many runs were there already."""

    runs: int
    boundaries: int
    branches: int
    maps: int
    known_runs: int


def merge(source: Store, target: Store) -> Merged:
    """Copy all that one store has into another; of a boundary or map in both, the newer one stays.

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
    boundaries, branches = _merge_boundaries(source, target), _merge_branches(source, target)
    return Merged(runs, boundaries, branches, _merge_maps(source, target), known)


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


def _merge_maps(source: Store, target: Store) -> int:
    there = {record.key: record.updated for record in target.maps()}
    newer = [each for each in source.maps() if each.key not in there or there[each.key] < each.updated]
    for record in newer:
        target.save_map(record)
    return len(newer)


def _merge_branches(source: Store, target: Store) -> int:
    missing = [key for key in source.branches.keys() if not target.branches.contains(key)]  # noqa: SIM118
    for key in missing:
        target.copy_branch(key, source)
    return len(missing)
