"""Nothing that the store did not make is deleted, and nothing that was computed is lost."""

from __future__ import annotations

import errno
import json
import os
import shutil
import sqlite3
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from ensemble.store import Store, StoreError, StoreInputError, staging
from ensemble.store.merge import merge
from ensemble.store.repair import repair
from tests.ensemble.group_files import unpacked
from tests.ensemble.runs import assert_same_run, shear_run, shear_scene
from tests.ensemble.search.test_boundary_reading import boundary


def numbered_run(number: int):
    return shear_run(shear_scene(rate=1 + number / 128), seed=number)


def filled(path: Path, *numbers: int) -> Path:
    with Store.open(path) as store:
        for number in numbers:
            store.save(numbered_run(number))
    return path


def contents(path: Path) -> dict[str, tuple[int, bytes]]:
    """Every file below a directory with its mode and its bytes."""
    return {
        str(file.relative_to(path)): (file.lstat().st_mode, file.read_bytes())
        for file in sorted(path.rglob("*"))
        if file.is_file()
    }


def keys(path: Path) -> set[str]:
    with Store.existing(path) as store:
        return {summary.key for summary in store.summaries()}


# Runs that are not in the catalog


def test_runs_copied_into_a_store_are_adopted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    first, second = filled(tmp_path / "first", 0, 1), filled(tmp_path / "second", 1, 2, 3)
    subprocess.run(["cp", "-rn", f"{second}/.", f"{first}/"], check=False)
    with Store.existing(first) as store:
        assert len([line for line in store.check() if "not in the catalog" in line]) == 2
    with Store.open(first) as store:
        assert store.check() == []
        for number in range(4):
            run = numbered_run(number)
            (summary,) = store.summaries([f"flow.rate={run.scene.flow.rate}"])
            assert_same_run(store.load(summary.key), run)
    assert "adopted 2 runs" in caplog.text


def test_an_older_catalog_put_back_costs_nothing(tmp_path: Path) -> None:
    path = filled(tmp_path / "store", 0)
    shutil.copy(path / "catalog.sqlite", tmp_path / "older")
    filled(path, 1, 2)
    shutil.copy(tmp_path / "older", path / "catalog.sqlite")
    assert len(keys(path)) == 1
    filled(path)
    assert len(keys(path)) == 3


def test_a_run_that_is_torn_and_not_in_the_catalog_is_moved_and_not_deleted(tmp_path: Path) -> None:
    path, other = filled(tmp_path / "store", 0), filled(tmp_path / "other", 1)
    (key,) = keys(other)
    shutil.copytree(other / "runs" / key, path / "runs" / key)
    with unpacked(path / "runs" / key) as files:
        (files / "gap" / "c" / "0").unlink()
    torn = contents(path / "runs" / key)
    filled(path)
    assert not (path / "runs" / key).exists()
    assert contents(path / "lost+found" / key) == torn


def test_a_run_of_a_newer_version_is_left_alone_and_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path, other = filled(tmp_path / "store", 0), filled(tmp_path / "other", 1)
    (key,) = keys(other)
    shutil.copytree(other / "runs" / key, path / "runs" / key)
    with unpacked(path / "runs" / key) as files:
        metadata = json.loads((files / "zarr.json").read_text())
        metadata["attributes"]["a_field_of_the_future"] = 1
        metadata["attributes"]["versions"]["vesicle-ensemble"] = "9.0"
        (files / "zarr.json").write_text(json.dumps(metadata))
    before = contents(path / "runs" / key)
    filled(path)
    assert contents(path / "runs" / key) == before
    assert key in caplog.text
    assert "version 9.0" in caplog.text


def test_what_is_not_the_stores_is_left_alone(tmp_path: Path) -> None:
    path = filled(tmp_path / "store", 0)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "data").write_text("mine")
    for directory in (path, path / "runs", path / "staging"):
        (directory / ".DS_Store").touch()
        (directory / "notes.txt").write_text("a note")
        (directory / "my runs").mkdir()
        (directory / "link").symlink_to(tmp_path / "elsewhere")
        (directory / ("0" * 32)).symlink_to(tmp_path / "elsewhere")
    (path / "staging" / ("a" * 32)).mkdir()  # no lock: no writer made it
    (path / "staging" / ("a" * 32) / "data").write_text("mine")
    before = contents(path)
    filled(path, 1)
    after = contents(path)
    assert {name for name in before if after.get(name) != before[name]} <= {"catalog.sqlite"}
    assert (tmp_path / "elsewhere" / "data").read_text() == "mine"
    with Store.existing(path) as store:
        assert store.check() == []


def test_a_new_directory_with_hidden_files_becomes_a_store(tmp_path: Path) -> None:
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / ".DS_Store").touch()
    assert len(keys(filled(tmp_path / "store", 0))) == 1


# A catalog that is lost or damaged


@pytest.mark.parametrize(
    "damage",
    [
        lambda catalog: catalog.unlink(),
        lambda catalog: catalog.write_bytes(b"no database" * 1000),
        lambda catalog: catalog.write_bytes(b""),
        lambda catalog: catalog.write_bytes(catalog.read_bytes()[:5000]),
    ],
    ids=["lost", "no database", "empty", "cut short"],
)
def test_a_lost_or_damaged_catalog_is_refused_and_rebuilt(
    tmp_path: Path, damage: Callable[[Path], object]
) -> None:
    path = filled(tmp_path / "store", 0, 1, 2)
    known = keys(path)
    damage(path / "catalog.sqlite")
    before = contents(path)
    for opening in (Store.open, Store.existing):
        with pytest.raises(StoreInputError, match=r"check --repair"):
            opening(path)
    assert contents(path) == before
    done = repair(path)
    assert any("adopted 3 runs" in line for line in done)
    assert keys(path) == known
    with Store.existing(path) as store:
        assert store.check() == []


def test_repair_sets_damaged_runs_aside_so_that_they_are_made_again(tmp_path: Path) -> None:
    path = filled(tmp_path / "store", 0, 1, 2)
    whole, damaged, missing = sorted(keys(path))
    with unpacked(path / "runs" / damaged) as files:
        (files / "gap" / "c" / "0").unlink()
    kept = contents(path / "runs" / damaged)
    shutil.rmtree(path / "runs" / missing)
    with Store.existing(path) as store:
        problems = store.check()
        with pytest.raises(StoreError, match="no readable group"):
            store.load(missing)
    assert [key in problem for key, problem in zip((missing, damaged), problems, strict=True)] == [True] * 2
    done = repair(path)
    assert len(done) == 2
    assert keys(path) == {whole}
    assert contents(path / "lost+found" / damaged) == kept
    assert repair(path) == []


def test_a_record_that_this_version_cannot_read_stops_nothing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = filled(tmp_path / "store", 0, 1)
    first, second = sorted(keys(path))
    with sqlite3.connect(path / "catalog.sqlite") as catalog:
        (text,) = catalog.execute("SELECT document FROM runs WHERE key = ?", (first,)).fetchone()
        document = json.dumps(json.loads(text) | {"a_field_of_the_future": 1})
        catalog.execute("UPDATE runs SET document = ? WHERE key = ?", (document, first))
    assert keys(path) == {second}
    assert first in caplog.text
    with Store.existing(path) as store:
        (problem,) = store.check()
        assert first in problem
        with pytest.raises(StoreError, match="a_field_of_the_future"):
            store.summary(first)
    filled(path, 2)
    assert len(keys(path)) == 2


# Commits that fail


def test_a_commit_waits_for_a_catalog_that_is_locked(tmp_path: Path) -> None:
    path = filled(tmp_path / "store")
    script = (
        "import sqlite3, sys, time; c = sqlite3.connect(sys.argv[1]); c.execute('BEGIN EXCLUSIVE');"
        "print('locked', flush=True); time.sleep(2); c.rollback()"
    )
    with Store.open(path) as store:
        staged = store.stage(numbered_run(0))
        command = [sys.executable, "-c", script, str(path / "catalog.sqlite")]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as other:
            assert other.stdout is not None
            assert other.stdout.readline() == "locked\n"
            assert store.commit(staged) == staged.key
        assert store.contains(staged.key)


def test_a_run_whose_commit_fails_is_kept_and_adopted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The catalog is taken away after the run is made; it comes back later."""
    path = filled(tmp_path / "store")
    monkeypatch.setattr(staging, "DISK_SECONDS", 0.5)
    with Store.open(path) as store:
        staged = store.stage(numbered_run(0))
        (path / "catalog.sqlite").rename(tmp_path / "away")
        (path / "catalog.sqlite").mkdir()
        with pytest.raises(StoreError, match="it is kept in"):
            store.commit(staged)
    (path / "catalog.sqlite").rmdir()
    (tmp_path / "away").rename(path / "catalog.sqlite")
    filled(path)
    with Store.existing(path) as store:
        assert_same_run(store.load(staged.key), numbered_run(0))


# Merging


def test_merging_brings_runs_and_the_newer_boundaries(tmp_path: Path) -> None:
    first, second = filled(tmp_path / "first", 0, 1), filled(tmp_path / "second", 1, 2)
    traced = boundary()
    with Store.open(second) as store:
        store.save_boundary(traced)
        created = {summary.key: summary.created for summary in store.summaries()}
    before = contents(second)
    with Store.existing(second) as source, Store.open(first) as target:
        assert merge(source, target) == (1, 1, 0, 0, 1)
        assert merge(source, target) == (0, 0, 0, 0, 2)
        assert target.check() == []
        (new,) = target.summaries([f"flow.rate={numbered_run(2).scene.flow.rate}"])
        assert new.created == created[new.key]
        assert_same_run(target.load(new.key), numbered_run(2))
        assert target.boundaries() == [traced]
    assert contents(second) == before


# Stores that are shared or read-only


@pytest.fixture
def umask() -> Iterator[Callable[[int], int]]:
    previous = os.umask(0o022)
    yield os.umask
    os.umask(previous)


def test_what_the_store_makes_honors_the_umask(tmp_path: Path, umask: Callable[[int], int]) -> None:
    umask(0o002)
    path = filled(tmp_path / "store", 0)
    with Store.open(path) as store:
        store.stage(numbered_run(1))
        private = [
            str(file.relative_to(path))
            for file in path.rglob("*")
            if not stat.S_IMODE(file.stat().st_mode) & stat.S_IWGRP
        ]
    assert private == []


def test_reading_leaves_no_trace(tmp_path: Path) -> None:
    path = filled(tmp_path / "store", 0)
    before = contents(path)
    with Store.existing(path) as store:
        (summary,) = store.summaries()
        store.load(summary.key)
        assert store.check() == []
        assert contents(path) == before
    assert contents(path) == before


@pytest.fixture
def unprivileged() -> Iterator[Callable[[str, Path], subprocess.CompletedProcess[str]]]:
    """Run a script as a user who owns nothing; only root can."""
    if os.getuid() != 0:
        pytest.skip("only root can become another user")

    def run(script: str, path: Path) -> subprocess.CompletedProcess[str]:
        # Another user may not reach the interpreter's libraries, so all that is needed is imported before.
        begin = "import os, sys; from pathlib import Path; from ensemble.store import Store\n"
        begin += "path = Path(sys.argv[1])\nwith Store.existing(path) as s: s.summaries(); s.check()\n"
        begin += "os.setgroups([]); os.setgid(65534); os.setuid(65534)\n"
        return subprocess.run(
            [sys.executable, "-c", begin + script, str(path)],
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "HOME": "/nonexistent"},
            capture_output=True,
            text=True,
            check=False,
        )

    return run


@pytest.fixture
def public_directory() -> Iterator[Path]:
    """A directory that every user reaches; that of pytest is private."""
    with TemporaryDirectory() as directory:
        Path(directory).chmod(0o755)
        yield Path(directory)


def test_a_store_of_somebody_else_is_read_and_refused_for_writing_at_once(
    public_directory: Path, unprivileged: Callable[[str, Path], subprocess.CompletedProcess[str]]
) -> None:
    path = filled(public_directory / "store", 0)
    read = "with Store.existing(path) as s: print(len(s.summaries()), s.check())"
    before = contents(path)
    result = unprivileged(read, path)
    assert result.stdout == "1 []\n", result.stderr
    result = unprivileged("Store.open(path)", path)
    assert "cannot be opened (no permission to write to" in result.stderr
    assert contents(path) == before


@pytest.mark.parametrize("whole", [True, False], ids=["log merged", "log left behind"])
def test_a_catalog_with_a_write_ahead_log_is_read_without_a_trace(tmp_path: Path, whole: bool) -> None:
    """As earlier versions made it."""
    path = filled(tmp_path / "store", 0)
    with Store.open(path) as store:
        (first,) = store.summaries()
    connection = sqlite3.connect(path / "catalog.sqlite")
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute("PRAGMA wal_autocheckpoint=0")
    connection.execute("UPDATE runs SET created = created")
    connection.commit()
    if not whole:
        shutil.copytree(path, tmp_path / "copy")
        path = tmp_path / "copy"
        (path / "catalog.sqlite-shm").unlink()
        assert (path / "catalog.sqlite-wal").stat().st_size > 0
    connection.close()
    before = contents(path)
    assert keys(path) == {first.key}
    assert contents(path) == before
    filled(path, 1)
    assert len(keys(path)) == 2
    assert not list(path.glob("catalog.sqlite-*"))


# File systems that lack something


def test_a_file_system_that_does_not_flush_directories_is_accepted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No such file system can be mounted here; the kernel's answer is the one that it gives."""
    flush = os.fsync

    def fsync(descriptor: int) -> None:
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        flush(descriptor)

    monkeypatch.setattr(os, "fsync", fsync)
    assert len(keys(filled(tmp_path / "store", 0))) == 1
