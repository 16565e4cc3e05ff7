"""Runs that are not done are seen as far as they have come."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable, Iterator
from functools import reduce
from operator import getitem
from pathlib import Path

import numpy as np
import pytest

from ensemble.config.figure_options import USUAL
from ensemble.errors import StoreError, StoreInputError, UnfinishedRunError
from ensemble.questions import kinds
from ensemble.store import RunStaging, Store
from ensemble.store.checkpoint import CHECKPOINTS, checkpoint_path
from ensemble.store.plain_hdf5 import read_plain, write_plain
from ensemble.store.unfinished import UnfinishedRun, interrupted_runs, unfinished_run
from solver import Outcome, Simulation, simulate
from solver.revision import RESULTS_REVISION
from solver.scene import Output, Scene
from tests.solver.restarts import PAIR, RELAXED, SCENES

ANEW = "; the next command that needs the run begins anew"
DENSE = Output(interval=0.01, frame_interval=0.02)
DENSE_PAIR = PAIR.model_copy(update={"output": DENSE})


@pytest.fixture
def staging(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[RunStaging]:
    monkeypatch.setattr("solver.analysis.record.BLOCK_BYTES", 1000)
    Store.open(tmp_path / "store").close()
    with RunStaging(tmp_path / "store") as opened:
        yield opened


def kept_after(staging: RunStaging, scene: Scene, steps: int) -> str:
    """The key of a run that has a checkpoint after so many steps, and has gone on."""
    checkpoint = staging.checkpoint(scene)
    simulation = Simulation(scene, sink=checkpoint.record)
    for _ in range(steps):
        simulation.step()
    checkpoint.write(simulation.saved())
    for _ in range(5):
        simulation.step()
    return checkpoint.key


@pytest.mark.parametrize("name", ["pair", "auto", "many", "moving frame"])
def test_what_is_seen_is_the_beginning_of_the_run(staging: RunStaging, name: str) -> None:
    scene = SCENES[name].model_copy(update={"output": DENSE})
    whole = simulate(scene)
    key = kept_after(staging, scene, whole.work.steps * 3 // 4)
    seen = UnfinishedRun.read(staging.path, key)
    assert seen.in_progress
    assert seen.scene == scene
    run = seen.run()
    assert run is not None
    assert 0 < run.time == seen.time < whole.time
    assert run.outcome is Outcome.UNDECIDED
    assert 0 < run.work.rhs_evaluations < whole.work.rhs_evaluations
    samples, frames = len(run.series["time"]), len(run.frames.time)
    assert 5 < samples < len(whole.series["time"])
    for part, expected in ((run.series, whole.series), (run.vesicle_series, whole.vesicle_series)):
        assert part.keys() == expected.keys()
        for each, values in part.items():
            np.testing.assert_array_equal(values, expected[each][:samples], err_msg=each)
    np.testing.assert_array_equal(run.frames.center, whole.frames.center[:frames])
    document = json.loads(json.dumps(seen.json_document()))
    assert (document["samples"], document["frames"]) == (samples, frames)
    assert document["last"]["time"] == run.series["time"][-1]


def test_a_start_that_relaxes_has_nothing_to_show(staging: RunStaging, tmp_path: Path) -> None:
    key = kept_after(staging, RELAXED, 5)
    with Store.existing(staging.path) as store:
        (answer,) = (found for kind in kinds() if (found := kind.stored(store, key[:8])))
    assert answer.json_document()["time"] is None
    assert answer.json_document()["last"] == {}
    with pytest.raises(ValueError, match="its start relaxes"):
        answer.draw(tmp_path / "run.png", USUAL)


def test_its_figure_is_that_of_a_run(staging: RunStaging, tmp_path: Path) -> None:
    key = kept_after(staging, PAIR, 20)
    with Store.existing(staging.path) as store:
        (answer,) = (found for kind in kinds() if (found := kind.stored(store, key)))
    answer.draw(tmp_path / "run.svg", USUAL)
    assert "the run has not ended" in (tmp_path / "run.svg").read_text()


def test_it_is_found_by_the_beginning_of_its_key(staging: RunStaging) -> None:
    key = kept_after(staging, PAIR, 5)
    found = unfinished_run(staging.path, key[:6])
    assert found is not None
    assert found.key == key
    assert unfinished_run(staging.path, "") is None
    assert unfinished_run(staging.path, "0" * 32) is None
    twin = checkpoint_path(staging.path, key[:6] + "0" * 26)
    twin.write_bytes(checkpoint_path(staging.path, key).read_bytes())
    with pytest.raises(StoreInputError, match="several"):
        unfinished_run(staging.path, key[:6])


def test_those_that_nobody_goes_on_with_are_named(tmp_path: Path, staging: RunStaging) -> None:
    with RunStaging(staging.path) as other:
        key = kept_after(other, PAIR, 5)
        assert list(interrupted_runs(staging.path)) == []
    (line,) = interrupted_runs(staging.path)
    assert line.startswith(f"run {key}: interrupted at time ")
    (staging.path / CHECKPOINTS / "notes.h5").write_text("of somebody")
    assert list(interrupted_runs(staging.path)) == [line]
    checkpoint_path(staging.path, key).write_bytes(b"torn")
    (line,) = interrupted_runs(staging.path)
    assert line == f"run {key}: its checkpoint cannot be used: it is damaged (cut short or changed){ANEW}"
    with pytest.raises(UnfinishedRunError, match="cannot be used"):
        unfinished_run(staging.path, key)


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (Path.unlink, "No such file or directory"),
        (lambda block: os.truncate(block, block.stat().st_size // 2), "cut short or changed"),
    ],
    ids=["gone", "torn"],
)
def test_one_whose_blocks_are_damaged_begins_anew(
    staging: RunStaging, damage: Callable[[Path], None], reason: str
) -> None:
    with RunStaging(staging.path) as other:
        key = kept_after(other, DENSE_PAIR, 20)
    seen = UnfinishedRun.read(staging.path, key)
    block = seen.place / "series-000000.h5"
    damage(block)
    expected = f"what it has recorded is damaged ({block.name}: {reason}){ANEW}"
    (line,) = interrupted_runs(staging.path)
    assert line == f"run {key}: its checkpoint cannot be used: {expected}"
    with pytest.raises(StoreError, match=block.name):  # and so it is when a command needs the run
        staging.checkpoint(DENSE_PAIR).read()
    with pytest.raises(UnfinishedRunError, match=re.escape(expected)):
        seen.run()


def test_one_that_goes_on_or_ends_while_it_is_read_is_not_called_damaged(staging: RunStaging) -> None:
    with RunStaging(staging.path) as other:
        key = kept_after(other, DENSE_PAIR, 20)
    interrupted = UnfinishedRun.read(staging.path, key)
    again = kept_after(staging, DENSE_PAIR, 25)  # and the blocks of the process that has ended are removed
    assert again == key
    going_on = UnfinishedRun.read(staging.path, key)
    shutil.rmtree(going_on.place)  # as when the run is staged
    for seen in (interrupted, going_on):
        for read in (seen.run, seen.series):
            with pytest.raises(UnfinishedRunError, match=f"run {key}: it goes on or ends, .*; try again"):
                read()
    staging.checkpoint(DENSE_PAIR).remove()
    assert unfinished_run(staging.path, key) is None


@pytest.mark.parametrize(
    ("lacks", "writer"), [(("record",), "an earlier"), (("simulation", "loop"), "another")]
)
def test_one_of_another_version_is_called_so(
    staging: RunStaging, lacks: tuple[str, ...], writer: str
) -> None:
    key = kept_after(staging, PAIR, 5)
    path = checkpoint_path(staging.path, key)
    content = read_plain(path)
    *groups, name = lacks
    del reduce(getitem, groups, content)[name]
    path.unlink()
    write_plain(path, content, {"key": key, "results_revision": RESULTS_REVISION})
    expected = f"run {key}: its checkpoint cannot be used: {writer} version wrote it{ANEW}"
    assert list(interrupted_runs(staging.path)) == [expected]
    with pytest.raises(UnfinishedRunError, match=re.escape(expected)):
        unfinished_run(staging.path, key)


def test_commands_tell_of_it(ensemble, staging: RunStaging, tmp_path: Path) -> None:
    with RunStaging(staging.path) as other:
        key = kept_after(other, PAIR, 20)
        shown = ensemble("show", key[:8], f"--store={staging.path}", "--json")
        assert shown.returncode == 0, shown.stderr
        document = json.loads(shown.stdout)
        assert document["run_key"] == key
        assert document["status"] == "in progress"
        assert 0 < document["time"] < PAIR.horizon == document["horizon"]
        progress = f"at time {document['time']:.6g} of {PAIR.horizon:g}"
        for command in (["export", key[:8], tmp_path / "run.h5"], ["start-from", key[:8]]):
            refused = ensemble(*map(str, command), f"--store={staging.path}")
            assert refused.returncode == 2
            assert f"{key} has not ended: in progress {progress}" in refused.stderr
        assert not (tmp_path / "run.h5").exists()
    checked = ensemble("check", f"--store={staging.path}")
    assert checked.returncode == 0
    whole, line = checked.stdout.splitlines()
    assert whole.endswith("is whole")
    assert line.startswith(f"run {key}: interrupted at time ")
