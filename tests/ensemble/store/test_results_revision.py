"""Runs of an earlier revision of the results: readable, listed with it, and never taken for new ones."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ensemble.config import run_key as keys
from ensemble.config.run_key import run_key
from ensemble.display.result_tables import list_table
from ensemble.questions.scene_question import SceneQuestion, run_document
from ensemble.store import Store, run_record
from ensemble.store.listing import Listing
from ensemble.store.run_record import RunSummary
from solver import RESULTS_REVISION
from tests.ensemble.group_files import unpack
from tests.ensemble.runs import assert_same_run, shear_run, shear_scene


def save_at(store: Store, revision: int, seed: int) -> str:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(keys, "RESULTS_REVISION", revision)
        patch.setattr(run_record, "RESULTS_REVISION", revision)
        return store.save(shear_run(seed=seed))


def test_a_run_of_an_earlier_revision_is_kept_beside_the_new_one(tmp_path: Path) -> None:
    with Store.open(tmp_path / "store") as store:
        earlier = save_at(store, RESULTS_REVISION - 1, seed=1)
        assert not store.contains(run_key(shear_scene()))
        now = store.save(shear_run(seed=2))
        assert now == run_key(shear_scene()) != earlier
        assert_same_run(store.load(earlier), shear_run(seed=1))
        assert_same_run(store.load(now), shear_run(seed=2))
        (found,) = store.summaries([f"results_revision={RESULTS_REVISION - 1}"])
        assert found.key == earlier
        assert run_document(found)["results_revision"] == RESULTS_REVISION - 1
        assert store.check() == []
        answers = SceneQuestion.all_stored(store, Listing(), [])
        *_, listed = list_table(answers.columns, answers.json_documents).columns
        assert sorted(listed.cells) == sorted([str(RESULTS_REVISION - 1), str(RESULTS_REVISION)])


def test_a_record_from_before_revisions_were_counted_is_read() -> None:
    document = RunSummary.of(shear_run()).document()
    assert document.pop("results_revision") == RESULTS_REVISION
    summary = RunSummary.model_validate(document)
    assert summary.results_revision is None
    assert summary.key == document["key"]


def test_a_stored_run_names_its_revision(tmp_path: Path) -> None:
    with Store.open(tmp_path / "store") as store:
        key = store.save(shear_run())
    directory = unpack(tmp_path / "store" / "runs" / key)
    attributes = json.loads((directory / "zarr.json").read_text())["attributes"]
    assert attributes["results_revision"] == RESULTS_REVISION
