"""Runs of one revision have the same digits, so that a store never takes old runs for new ones."""

from __future__ import annotations

import json

import pytest

from solver import RESULTS_REVISION
from tests.solver.revision_guard import SCENES, STORED, TOLERANCE, largest_change, results

STORED_RESULTS = json.loads(STORED.read_text())

WHAT_TO_DO = """
If results are meant to change:
  1. raise RESULTS_REVISION in solver/revision.py by one (once between two releases of the package);
  2. run `python -m tests.solver.revision_guard`, which stores the new results;
  3. say in CHANGELOG.md which results change and by how much.
If they are not, the last change of the code has an effect that it should not have."""


def test_the_stored_results_are_of_this_revision() -> None:
    stored = STORED_RESULTS["revision"]
    assert stored == RESULTS_REVISION, f"results of revision {stored} are stored.{WHAT_TO_DO}"
    assert STORED_RESULTS["results"].keys() == SCENES.keys(), WHAT_TO_DO


@pytest.mark.parametrize("name", SCENES)
def test_results_change_with_the_revision_only(name: str) -> None:
    change = largest_change(results(SCENES[name]), STORED_RESULTS["results"][name])
    assert change <= TOLERANCE, (
        f"the results of the scene {name!r} have changed by {change:.1e}, "
        f"and RESULTS_REVISION is still {RESULTS_REVISION}.{WHAT_TO_DO}"
    )


def test_the_guard_sees_a_change_and_what_is_missing() -> None:
    stored = {"gap": [0.5, 2.0]}
    assert largest_change({"gap": [0.5, 2.0 + 4e-8]}, stored) == pytest.approx(2e-8)
    assert largest_change({"gap": [0.5]}, stored) == float("inf")
    assert largest_change({"gap": [0.5, 2.0], "period": [1.0]}, stored) == float("inf")
