"""Kinds of question: how documents are recognized, keys of answers, costs and sizes."""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest

from ensemble.config.certifying_scene import certifying_scene
from ensemble.config.documents import load_scene, load_study, preset_document, preset_names
from ensemble.config.run_key import run_key
from ensemble.questions import kind_named, kind_of, kind_of_model, kinds, preset_question
from ensemble.questions.scene_question import SceneQuestion
from ensemble.questions.study_question import StudyQuestion
from solver.scene import Numerics
from solver.scene.scene import MOST_RECORDS


def test_markers_and_names_tell_the_kinds_apart() -> None:
    for name in ("kind", "marker", "command", "collection", "document_type"):
        values = [getattr(kind, name) for kind in kinds()]
        assert len(set(values)) == len(values)


def test_every_preset_is_of_one_kind() -> None:
    kinds_of_presets = Counter(kind_of(preset_document(name)).kind for name in preset_names())
    assert {"study", "scene"} <= kinds_of_presets.keys()
    assert all(kind_of(preset_document(name)) is type(preset_question(name, {})) for name in preset_names())


@pytest.mark.parametrize(
    "document", [{}, {"vesicles": [{}]}, preset_document("doublet-shear") | {"search": {}}]
)
def test_a_document_of_no_kind_or_of_two_is_refused(document: dict[str, Any]) -> None:
    with pytest.raises(
        ValueError, match=r"exactly one of the keys 'search' \(study\), 'axes' \(map\), 'errors' \(meas"
    ):
        kind_of(document)


def test_what_is_no_kind_is_refused() -> None:
    with pytest.raises(
        ValueError, match="'novel' is no kind of question; kinds: study, map, measurement, scene"
    ):
        kind_named("novel")
    with pytest.raises(ValueError, match="Numerics"):
        kind_of_model(Numerics())


def test_keys_are_those_of_the_answers() -> None:
    assert SceneQuestion(load_scene("doublet-shear")).key == run_key(load_scene("doublet-shear"))
    assert StudyQuestion(load_study("critical-hamaker")).key == load_study("critical-hamaker").key


def test_a_question_is_called_as_its_document_its_preset_or_its_kind() -> None:
    assert preset_question("critical-hamaker", {"name": "mine"}).name == "mine"
    changed = preset_question("critical-hamaker", {"sweep.values": [0.5]})
    assert changed.name == changed.document.name == "critical-hamaker, sweep.values=[0.5]"
    assert preset_question("doublet-shear", {"horizon": 5.0}).name == "doublet-shear"
    assert SceneQuestion(load_scene("doublet-shear")).name == "scene"


def test_the_scene_that_decides_about_ranks_is_that_of_the_document() -> None:
    assert preset_question("critical-hamaker", {}).scene == load_study("critical-hamaker").scene
    assert preset_question("doublet-shear", {}).scene == load_scene("doublet-shear")


def test_two_runs_at_finer_numerics_are_planned_at_each_point() -> None:
    study = load_study("critical-hamaker")
    finer = [
        (certifying_scene(study.scene_at(at, end)), 2) for at in study.places for end in study.search.limits
    ]
    for changes in ({}, {"search.certify": True}):  # a certification takes over the runs that confirm
        planned = list(preset_question("critical-hamaker", changes).planned_runs())
        assert sum(planned.count(each) for each in finer) == len(study.places)
        assert sum(count for _, count in planned) > 2 * len(planned)


def test_a_run_that_would_record_too_much_is_refused_by_its_interval() -> None:
    time = load_scene("doublet-shear").horizon
    least = time / MOST_RECORDS
    assert preset_question("doublet-shear", {"output.interval": 1.01 * least}).cost.runs == 1
    with pytest.raises(ValueError, match=r"output\.interval must be at least"):
        preset_question("doublet-shear", {"output.interval": 0.99 * least})
    # Also where only one limit of a search makes a run so long.
    changes = {"search.parameter": "horizon", "search.limits": [1.0, 4e4], "search.guesses": []}
    with pytest.raises(ValueError, match=r"output\.interval"):
        _ = preset_question("critical-hamaker", changes | {"scene.output.interval": 1e-2}).cost


@pytest.mark.parametrize(
    ("kind", "document", "message"),
    [
        ("scene", {"vesicles": [{}] * 257}, "vesicles: 257 elements — must be at most 256"),
        ("scene", {"arrangement": {"count": "300"}}, "arrangement: 300 vesicles — must be at most 256"),
        ("scene", {"arrangement": {"rows": 20, "columns": 20}}, "arrangement: 400 vesicles"),
        ("study", {"scene": {"vesicles": [{}] * 5}}, "scene.vesicles: 5 elements — must be at most 4"),
        ("study", {"scene": {"arrangement": {"count": 5}}}, "scene.arrangement: 5 vesicles"),
        ("study", {"sweep": {"values": [0.5] * 65}}, "sweep.values: 65 elements — must be at most 64"),
    ],
)
def test_a_document_that_is_too_large_is_refused(kind: str, document: Any, message: str) -> None:
    with pytest.raises(ValueError, match="^" + message):
        kind_named(kind).check_size(document)


@pytest.mark.parametrize("kind", ["scene", "study"])
@pytest.mark.parametrize("document", [None, 7, [], {"vesicles": "many", "scene": 3, "arrangement": []}])
def test_sizes_are_checked_whatever_the_document_is(kind: str, document: Any) -> None:
    kind_named(kind).check_size(document)


def test_summaries_of_answers() -> None:
    points = [
        {"status": "converged", "parameters": {"flow.rate": 0.5}, "incidental_changes": []},
        {"status": "unbracketed", "parameters": {"flow.rate": 1.0}, "incidental_changes": []},
        {"status": "converged", "parameters": {"flow.rate": 2.0}, "incidental_changes": [{}, {}]},
    ]
    study, scene = kind_named("study"), kind_named("scene")
    assert study.summary({"boundary": points}) == (
        "2 of 3 points converged; flow.rate 1: unbracketed (no change of the outcome within search.limits); "
        "flow.rate 2: other runs show further changes of the outcome"
    )
    assert scene.summary({"outcome": "bound", "failure": None}) == "bound"
    assert scene.summary({"outcome": "failed", "failure": "too distorted"}) == "too distorted"


def test_a_study_at_the_finest_numerics_plans_no_runs_that_confirm() -> None:
    fine = preset_question("critical-hamaker", {"scene.numerics.tolerance": 1e-11})
    usual = preset_question("critical-hamaker", {})
    assert {scene.numerics.tolerance for scene, _ in fine.planned_runs()} == {1e-11}
    assert fine.cost.runs == usual.cost.runs - 2 * 6
