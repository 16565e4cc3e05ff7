"""Studies that ask for the boundary between two configurations, or a configuration and an outcome."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from ensemble.config.documents import load_study
from ensemble.config.study import Study
from ensemble.search.point_search import SearchRun
from ensemble.search.study_planner import StudyPlanner
from ensemble.search.study_search import counted
from ensemble.search.task_queue import RunAnswer
from ensemble.store import Store
from solver.analysis.run import Configuration, Outcome
from tests.ensemble.runs import shear_run, shear_scene
from tests.ensemble.search.study_runs import trace

SEPARATES, TUMBLES = 0.4, 2.03


def study(low: str, high: str) -> Study:
    changes = ["sweep.values=[0.5]", f'search.low=["{low}"]', f'search.high=["{high}"]']
    return load_study("critical-hamaker", [*changes, "search.guesses=[]"])


def physics(task: SearchRun) -> RunAnswer:
    """Pairs separate, slide or tumble."""
    assert task.scene.adhesion
    hamaker = task.scene.adhesion.hamaker
    if hamaker < SEPARATES:
        return RunAnswer(Outcome.SEPARATED)
    configuration = Configuration.TUMBLING if hamaker > TUMBLES else Configuration.SLIDING
    return RunAnswer(Outcome.BOUND, configuration=configuration)


@pytest.mark.parametrize(
    ("low", "high", "critical"),
    [
        ("separated", "bound", SEPARATES),
        ("separated", "sliding", SEPARATES),
        ("sliding", "tumbling", TUMBLES),
    ],
)
def test_the_boundary_between_any_two_is_found(low: str, high: str, critical: float) -> None:
    planner = StudyPlanner(study(low, high), lambda key: None)
    trace(planner, physics)
    (point,) = planner.boundary().points
    assert point.bracket[0] is not None
    assert point.bracket[1] is not None
    assert point.bracket[0] < critical < point.bracket[1] < 1.011 * point.bracket[0]
    assert point.outcomes == (low, high)


def test_a_configuration_counts_where_the_study_names_it() -> None:
    sliding = RunAnswer(Outcome.BOUND, configuration=Configuration.SLIDING)
    assert counted(sliding, ("sliding", "tumbling")).outcome == "sliding"
    assert counted(sliding, ("separated", "bound")).outcome == "bound"
    assert counted(RunAnswer(Outcome.BOUND), ("sliding", "tumbling")).outcome == "bound"


def test_answers_of_a_store_have_their_configurations(tmp_path: Path) -> None:
    with Store.open(tmp_path / "store") as store:
        key = store.save(replace(shear_run(), configuration=Configuration.SLIDING))
        other = store.save(shear_run(shear_scene(rate=1.0)))
        assert store.answer(key) == RunAnswer(Outcome.BOUND, configuration=Configuration.SLIDING)
        assert store.answer(other) == RunAnswer(Outcome.BOUND)
        assert [found.key for found in store.summaries(["configuration=sliding"])] == [key]
        assert [found.key for found in store.summaries(["configuration=null"])] == [other]


def test_sides_share_no_name() -> None:
    with pytest.raises(ValueError, match="must share no outcome with low"):
        study("sliding", "sliding")
    with pytest.raises(ValueError, match=r"search\.low\.0: 'gliding'"):
        study("gliding", "bound")
