"""Whatever has happened to the files of a run: it is named and never read as another run."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ensemble.store import Store, StoreError
from tests.ensemble.group_files import unpack
from tests.ensemble.runs import assert_same_run, shear_run

RUN = shear_run(samples=8, frames=2)
RUN = replace(RUN, series={name: RUN.series[name] for name in ("time", "gap")})


@pytest.fixture(scope="module")
def archived(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with one run."""
    path = tmp_path_factory.mktemp("whole") / "store"
    with Store.open(path) as store:
        store.save(RUN)
    return path


@pytest.fixture(scope="module")
def whole(archived: Path) -> Path:
    """The same as earlier versions wrote it, with many files."""
    path = shutil.copytree(archived, archived.with_name("unpacked"))
    (run,) = (path / "runs").iterdir()
    unpack(run)
    return path


def lose(path: Path) -> None:
    path.unlink()


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def empty(path: Path) -> None:
    path.write_bytes(b"")


def overwrite(path: Path) -> None:
    path.write_bytes(bytes(range(256)))


def turn_into_directory(path: Path) -> None:
    path.unlink()
    path.mkdir()


def lose_directory(path: Path) -> None:
    shutil.rmtree(path)


def empty_directory(path: Path) -> None:
    shutil.rmtree(path)
    path.mkdir()


def turn_into_file(path: Path) -> None:
    shutil.rmtree(path)
    path.touch()


def places(document: object, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Every field of a JSON document."""
    if isinstance(document, dict):
        for name, value in document.items():
            yield (*path, name)
            yield from places(value, (*path, name))


def without(document: dict, place: tuple[str, ...]) -> dict:
    """A JSON document that lacks a field."""
    first, *others = place
    if not others:
        return {name: value for name, value in document.items() if name != first}
    return document | {first: without(document[first], tuple(others))}


def replaced(document: dict, place: tuple[str, ...]) -> dict:
    """A JSON document in which a field holds something else."""
    first, *others = place
    return document | {first: replaced(document[first], tuple(others)) if others else ["something else"]}


def named_or_unharmed(store: Path) -> None:
    """A run is either what it was, or named as damaged by all who read it."""
    with Store.existing(store) as opened:
        (record,) = opened.runs_page()
        problems = opened.check()
        assert all(record.key in problem for problem in problems)
        if not problems:
            assert_same_run(opened.load(record.key), RUN)
            return
        # What only the catalog does not agree with is named by `check` alone.
        with suppress(StoreError):
            opened.load(record.key)


@pytest.mark.parametrize(
    "damage", [lose, cut, empty, overwrite, turn_into_directory], ids=lambda f: f.__name__
)
def test_files(whole: Path, tmp_path: Path, damage: Callable[[Path], None]) -> None:
    for file in sorted(path for path in (whole / "runs").rglob("*") if path.is_file()):
        store = shutil.copytree(whole, tmp_path / "store")
        damage(store / file.relative_to(whole))
        named_or_unharmed(store)
        with Store.existing(store) as opened:
            assert opened.check(), f"{damage.__name__} {file.name}"
        shutil.rmtree(store)


@pytest.mark.parametrize(
    "damage", [lose, cut, empty, overwrite, turn_into_directory], ids=lambda f: f.__name__
)
def test_an_archive(archived: Path, tmp_path: Path, damage: Callable[[Path], None]) -> None:
    store = shutil.copytree(archived, tmp_path / "store")
    damage(next((store / "runs").glob("*/zarr.zip")))
    named_or_unharmed(store)
    with Store.existing(store) as opened:
        assert opened.check()


def test_any_byte_of_an_archive(archived: Path, tmp_path: Path) -> None:
    """A wrong byte is found, or changes nothing that is read.  Takes 3 s."""
    store = shutil.copytree(archived, tmp_path / "store")
    archive = next((store / "runs").glob("*/zarr.zip"))
    content = archive.read_bytes()
    random = np.random.default_rng(0)
    for place in [*random.integers(0, len(content), 40), *range(len(content) - 22, len(content))]:
        changed = bytearray(content)
        changed[place] ^= 1 << random.integers(0, 8)
        archive.write_bytes(changed)
        named_or_unharmed(store)


@pytest.mark.parametrize(
    "damage", [lose_directory, empty_directory, turn_into_file], ids=lambda f: f.__name__
)
def test_directories(whole: Path, tmp_path: Path, damage: Callable[[Path], None]) -> None:
    for directory in sorted(path for path in (whole / "runs").rglob("*") if path.is_dir()):
        store = shutil.copytree(whole, tmp_path / "store")
        damage(store / directory.relative_to(whole))
        named_or_unharmed(store)
        shutil.rmtree(store)


@pytest.mark.parametrize("change", [without, replaced], ids=lambda f: f.__name__)
def test_fields(whole: Path, tmp_path: Path, change: Callable[[dict, tuple[str, ...]], dict]) -> None:
    (run,) = (whole / "runs").iterdir()
    for file in (run / "zarr.json", run / "gap" / "zarr.json"):
        document = json.loads(file.read_text())
        for place in [place for place in places(document) if len(place) < 3]:
            store = shutil.copytree(whole, tmp_path / "store")
            (store / file.relative_to(whole)).write_text(json.dumps(change(document, place)))
            named_or_unharmed(store)
            shutil.rmtree(store)
