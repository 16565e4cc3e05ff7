"""Damage to one map or boundary is named, stops nothing else, and is repaired without deleting anything."""

from __future__ import annotations

import logging
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
import xarray

from ensemble.cli.store_commands import _stored
from ensemble.errors import StoreError
from ensemble.questions.map_question import MapQuestion
from ensemble.store import Store
from ensemble.store.listing import Listing
from ensemble.store.merge import merge
from ensemble.store.repair import repair
from tests.ensemble.runs import shear_run
from tests.ensemble.search.test_boundary_reading import boundary
from tests.ensemble.search.test_maps import drawn

RECORD, _ = drawn({})
OTHER = RECORD.model_copy(update={"key": "0" * 16, "name": "another"})
BOUNDARY = boundary()


def overwrite(archive: Path) -> None:
    content = archive.read_bytes()
    archive.write_bytes(b"damaged " * 100 + content[800:])


def cut(archive: Path) -> None:
    archive.write_bytes(archive.read_bytes()[:400])


def lose(archive: Path) -> None:
    archive.unlink()


def take_the_place_of_another(archive: Path) -> None:
    other = archive.parent.with_name(OTHER.key) / archive.name
    shutil.copyfile(other, archive)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A store with a run, a boundary and two maps."""
    with Store.open(tmp_path / "store") as store:
        store.save(shear_run(samples=4, frames=2))
        store.save_boundary(BOUNDARY)
        store.save_boundary_arrays(BOUNDARY)
        for record in (RECORD, OTHER):
            store.save_map(record)
        assert store.check() == []
    return tmp_path / "store"


@pytest.mark.parametrize(
    "damage", [overwrite, cut, lose, take_the_place_of_another], ids=lambda f: f.__name__
)
def test_a_damaged_map_stops_nothing_else_and_is_set_aside(
    path: Path, tmp_path: Path, damage: Callable[[Path], None], caplog: pytest.LogCaptureFixture
) -> None:
    damage(path / "maps" / RECORD.key / "zarr.zip")
    kept = [file.read_bytes() for file in sorted((path / "maps" / RECORD.key).iterdir())]
    with Store.existing(path) as store, Store.open(tmp_path / "target") as target:
        (problem,) = store.check()
        assert f"map {RECORD.key}" in problem
        with caplog.at_level(logging.WARNING):
            assert store.maps() == [OTHER]
        assert [RECORD.key in record.getMessage() for record in caplog.records] == [True]
        (run,) = store.summaries()
        assert _stored(store, run.key).json_document()["key"] == run.key
        assert _stored(store, OTHER.name).json_document()["key"] == OTHER.key
        assert MapQuestion.stored(store, "nothing") is None
        with pytest.raises(StoreError, match=RECORD.key):
            MapQuestion.stored(store, RECORD.key)
        assert len(list(MapQuestion.all_stored(store, Listing(), ()).json_documents)) == 1
        assert merge(store, target).maps == 1
    assert list(xarray.open_datatree(path)["maps"]) == [OTHER.key]
    (done,) = repair(path)
    assert "set aside" in done
    aside = path / "lost+found" / RECORD.key
    assert [file.read_bytes() for file in sorted(aside.iterdir())] == kept
    with Store.open(path) as store:
        assert store.check() == []
        store.save_map(RECORD)
        assert len(store.maps()) == 2


@pytest.mark.parametrize("damage", [overwrite, lose], ids=lambda f: f.__name__)
def test_a_damaged_boundary_stops_nothing_else_and_is_set_aside(
    path: Path, damage: Callable[[Path], None]
) -> None:
    damage(path / "boundaries" / BOUNDARY.study_key / "zarr.zip")
    with Store.existing(path) as store:
        (problem,) = store.check()
        assert f"boundary {BOUNDARY.study_key}" in problem
    (done,) = repair(path)
    assert "set aside" in done
    assert (path / "lost+found" / BOUNDARY.study_key).is_dir()
    with Store.existing(path) as store:
        assert store.check() == []
        assert store.boundaries() == [BOUNDARY]


def test_boundaries_come_back_with_a_rebuilt_catalog(path: Path) -> None:
    (path / "catalog.sqlite").unlink()
    assert any("restored 1 boundaries" in line for line in repair(path))
    with Store.existing(path) as store:
        assert store.boundaries() == [BOUNDARY]
        assert store.check() == []
    assert repair(path) == []


def test_folders_that_are_not_the_stores_are_left_alone(path: Path) -> None:
    foreign = [path / folder / "notes" for folder in ("maps", "boundaries", "branches")]
    for folder in foreign:
        folder.mkdir(parents=True)
    with Store.open(path) as store:
        assert store.check() == []
        assert {record.key for record in store.maps()} == {RECORD.key, OTHER.key}
    repair(path)
    assert all(folder.is_dir() for folder in foreign)
