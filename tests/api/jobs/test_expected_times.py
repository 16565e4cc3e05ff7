"""The time that a job is likely to take, from runs that are like its own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from api.jobs.expected_times import ExpectedTimes
from api.jobs.submissions import JobLimits, estimate
from ensemble.questions import preset_question
from ensemble.store import Store
from solver.analysis.run import Outcome
from tests.ensemble.runs import failed_run, shear_run, shear_scene

LIMITS = JobLimits(cost=1e9, recorded=1e9, memory=1e10)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store.open(tmp_path / "store") as opened:
        yield opened


def keep(store: Store, *seconds: float, outcome: Outcome = Outcome.BOUND, time: float = 50.0) -> None:
    """Store runs of 32 points that took so long."""
    for number, each in enumerate(seconds):
        run = shear_run(shear_scene(rate=0.5 + 0.01 * number), outcome)
        store.save(replace(run, time=time, work=replace(run.work, wall_seconds=each)))


def expected(store: Store, preset: str, ranks: int = 1, **changes: Any) -> float | None:
    question = preset_question(preset, {path.replace("__", "."): value for path, value in changes.items()})
    return ExpectedTimes(store).added(estimate(question, LIMITS), question, ranks).seconds


def test_a_run_takes_as_long_as_those_like_it_but_for_the_extremes(store):
    keep(store, 20.0, 1.0, 3.0, 0.1)  # the first one has compiled
    assert expected(store, "doublet-shear", numerics__points=32) == pytest.approx(2.0)
    assert expected(store, "doublet-shear", numerics__points=64) == pytest.approx(4.0)
    assert expected(store, "doublet-shear", numerics__points="auto") == pytest.approx(2.0)
    # Decided at 50, so a later end costs nothing; an earlier one cuts it off.
    assert expected(store, "doublet-shear", numerics__points=32, horizon=25.0) == pytest.approx(1.0)
    assert expected(store, "doublet-shear", 2, numerics__points=32) == pytest.approx(2.0)


def test_a_run_that_its_end_decides_takes_longer_with_a_later_one(store):
    keep(store, 1.0, outcome=Outcome.UNDECIDED)
    assert expected(store, "doublet-shear", numerics__points=32, horizon=200.0) == pytest.approx(4.0)


def test_the_ranks_of_a_study_share_its_runs(store):
    keep(store, 1.0)
    alone = expected(store, "critical-hamaker")
    assert alone is not None
    question = preset_question("critical-hamaker", {})
    finer = sum(count for scene, count in question.planned_runs() if scene.numerics.points == 96)
    assert alone == pytest.approx(2 * (question.cost.runs - finer) + 3 * finer)
    assert expected(store, "critical-hamaker", 2) == pytest.approx(alone / 2)


def test_other_runs_say_nothing(store):
    store.save(failed_run())
    assert expected(store, "doublet-shear") is None
    keep(store, 1.0)
    for preset in ("doublet-trap", "doublet-quiescent", "vesicle-shear", "critical-hamaker-contrast"):
        assert expected(store, preset) is None
