"""Full disks and quotas wherever something is written: one line, nothing torn, no run lost that can be kept.

The largest size of a file stands for a quota: both are told by the write that goes beyond.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from ensemble.store import Store, StoreError, staging
from tests.api.stores import example_boundary
from tests.conftest import ENSEMBLE
from tests.ensemble.catalog_conformance import NOON, boundary
from tests.ensemble.runs import assert_same_run, shear_run
from tests.full_disks import ENTRIES, ROOM, filled, small_disk

RUN = shear_run()


@pytest.fixture
def store(tmp_path: Path) -> Path:
    with Store.open(tmp_path / "store") as opened:
        opened.save(RUN)
        opened.save_boundary(example_boundary())
    return tmp_path / "store"


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(staging, "DISK_SECONDS", 0.2)


@pytest.fixture(params=[ROOM, ENTRIES])
def disk(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Path]:
    with small_disk(tmp_path / "disk", request.param) as mounted:
        yield mounted


def key_of(store: Path) -> str:
    with Store.existing(store) as opened:
        (summary,) = opened.summaries()
        return summary.key


# A run, from its computation to the catalog


@pytest.mark.parametrize("command", [["run", "vesicle-shear"], ["report", "stability"]])
def test_a_quota_that_is_used_up_is_known_before_anything_is_computed(
    ensemble, store: Path, command: list[str]
) -> None:
    result = ensemble(*command, f"--store={store}", largest_file=1 << 16)
    assert result.returncode == 1
    (line,) = result.stderr.splitlines()
    assert "cannot be written to (File too large)" in line
    assert key_of(store)


STAGE = """
import resource, sys
from pathlib import Path
from ensemble.store import Store, StoreError, staging
from tests.ensemble.runs import shear_run, shear_scene
staging.DISK_SECONDS = 0.2
run = shear_run(seed=1)
with Store.open(Path(sys.argv[1])) as store:
    for rate in (1.0, 2.0, 3.0):
        store.save(shear_run(shear_scene(rate)))
    written = store.stage(run) if sys.argv[2] == "commit" else None
    size = (store.path / "catalog.sqlite").stat().st_size if written else 500
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    try:
        store.commit(written) if written else store.stage(run)
    except StoreError as error:
        print(error)
"""


@pytest.mark.parametrize("site", ["staging", "commit"])
def test_a_quota_that_is_used_up_by_a_run(tmp_path: Path, site: str) -> None:
    store = tmp_path / "store"
    Store.open(store).close()
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    result = subprocess.run(
        [sys.executable, "-c", STAGE, str(store), site],
        env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    (line,) = result.stdout.splitlines()
    with Store.open(store) as opened:
        assert opened.check() == []
        if site == "commit":
            assert "it is kept in" in line
            *_, summary = opened.summaries()
            assert_same_run(opened.load(summary.key), shear_run(seed=1))
        else:
            assert "File too large" in line
        assert len(opened.summaries()) == (4 if site == "commit" else 3)
        assert list((store / "staging").iterdir()) == []


def test_a_run_that_the_store_does_not_take_is_kept_elsewhere(store: Path, impatient: None) -> None:
    run = shear_run(seed=1, scene=shear_run().scene.model_copy(update={"horizon": 50.0}))
    with Store.open(store) as opened:
        (store / "staging").rmdir()
        (store / "staging").touch()
        with pytest.raises(StoreError, match="is kept in") as refused:
            opened.stage(run)
        (store / "staging").unlink()
    assert "\n" not in str(refused.value)
    kept = Path(str(refused.value).partition("is kept in ")[2].partition(":")[0])
    shutil.move(kept, store / "runs")
    kept.parent.rmdir()
    with Store.open(store) as opened:
        assert_same_run(opened.load(kept.name), run)


def test_a_full_disk_while_a_run_is_stored(ensemble, disk: Path, impatient: None) -> None:
    second = shear_run(seed=1, scene=shear_run().scene.model_copy(update={"horizon": 50.0}))
    with Store.open(disk / "store") as store:
        staged = store.stage(RUN)
        with filled(disk):
            with pytest.raises(StoreError, match="it is kept in"):
                store.commit(staged)
            with pytest.raises(StoreError, match="goes on"):
                store.save_boundary(boundary("a", 0.25, 1.0, NOON))
            with pytest.raises(StoreError, match=r"No space left on device.* is kept in") as refused:
                store.stage(second)
            result = ensemble("run", "vesicle-shear", f"--store={store.path}")
            assert result.returncode == 1
            (line,) = result.stderr.splitlines()
            assert "No space left on device" in line
    kept = Path(str(refused.value).partition("is kept in ")[2].partition(":")[0])
    shutil.move(kept, disk / "store" / "runs")
    kept.parent.rmdir()
    with Store.open(disk / "store") as store:
        assert store.check() == []
        assert_same_run(store.load(staged.key), RUN)
        assert_same_run(store.load(kept.name), second)


# Files that commands write


@pytest.mark.parametrize("name", ["run.h5", "run.png", "diagram.svg", "diagram.pdf"])
def test_a_quota_that_is_used_up_by_a_file(ensemble, store: Path, tmp_path: Path, name: str) -> None:
    output = tmp_path / "files" / name
    output.parent.mkdir()
    output.write_text("what was there")
    key = key_of(store) if name.startswith("run") else "critical-hamaker"
    command = ["export", key, str(output)] if name.endswith(".h5") else ["show", key, f"--output={output}"]
    result = ensemble(*command, f"--store={store}", largest_file=1 << 10)
    assert result.returncode == 1, result.stderr
    (line,) = result.stderr.splitlines()
    assert line.startswith("ensemble: ")
    assert output.read_text() == "what was there"
    assert list(output.parent.iterdir()) == [output]


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_output_that_goes_to_a_full_disk(store: Path, options: list[str]) -> None:
    with Path("/dev/full").open("w") as full:
        result = subprocess.run(
            [*ENSEMBLE, "query", "runs", *options, f"--store={store}"],
            stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert result.returncode == 1
    (line,) = result.stderr.splitlines()
    assert "No space left on device" in line


def test_what_a_killed_export_leaves_is_removed_by_the_next(ensemble, store: Path, tmp_path: Path) -> None:
    killed = (
        "import os, signal; from ensemble.disk import replacing; from pathlib import Path; import sys\n"
        "with replacing(Path(sys.argv[1])) as file:\n"
        "    file.write_text('torn'); os.kill(os.getpid(), signal.SIGKILL)"
    )
    directory = tmp_path / "files"
    directory.mkdir()
    mine = directory / ".unfinished-business"
    mine.touch()
    output = directory / "run.h5"
    subprocess.run([sys.executable, "-c", killed, str(output)], check=False)
    subprocess.run([sys.executable, "-c", killed, str(directory / "other.h5")], check=False)
    assert len(list(directory.iterdir())) == 3
    assert ensemble("export", key_of(store), str(output), f"--store={store}").returncode == 0
    left = set(directory.iterdir()) - {output, mine}
    assert len(left) == 1  # of the other file
