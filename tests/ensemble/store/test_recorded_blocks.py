"""What a run records is on disk block by block, and ends as the arrays that it would have had in memory.

About 8 s of processor time."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from zipfile import ZipFile

import pytest

from ensemble.errors import StoreError
from ensemble.store import RunStaging, Store
from ensemble.store.checkpoint import CHECKPOINTS, Checkpoint, checkpoint_path
from ensemble.store.writers import STAGING
from solver import Run, Simulation, simulate
from solver.scene import Output, Scene
from tests.full_disks import ROOM, filled, small_disk
from tests.solver.restarts import PAIR, SCENES, arrays_of

OUTPUT = Output(interval=0.1, frame_interval=0.2)
DENSE = {
    name: SCENES[name].model_copy(update={"output": OUTPUT})
    for name in ("pair", "auto", "many", "moving frame", "relaxed")
}
LONG = DENSE["pair"]


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("solver.analysis.record.BLOCK_BYTES", 1000)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store.open(tmp_path / "store") as opened:
        yield opened


def directories(store: Path, scene: Scene) -> set[str]:
    """The processes that have recorded something of a run."""
    place = store / CHECKPOINTS / Checkpoint(store, scene, lambda: store).key
    return {path.name for path in place.iterdir()} if place.exists() else set()


def begun(staging: RunStaging | Store, scene: Scene, steps: int) -> tuple[Simulation, Checkpoint]:
    """A run that goes on from its checkpoint, some steps on."""
    checkpoint = staging.checkpoint(scene)
    saved = checkpoint.read()
    if saved is None:
        simulation = Simulation(scene, sink=checkpoint.record)
    else:
        simulation = Simulation.restored(scene, saved, sink=checkpoint.record)
    for _ in range(steps):
        if not simulation.done:
            simulation.step()
    return simulation, checkpoint


def cut(store: Path, scene: Scene) -> None:
    """Make some of a run in a process that ends some steps after its checkpoint."""
    with RunStaging(store) as staging:
        simulation, checkpoint = begun(staging, scene, 9)
        if not simulation.done:
            checkpoint.write(simulation.saved())
        for _ in range(6):
            if not simulation.done:
                simulation.step()


def finished(store: Store, scene: Scene) -> Run:
    simulation, checkpoint = begun(store, scene, 0)
    store.commit(store.stage_recorded(simulation.finish(), checkpoint.record))
    return store.load(checkpoint.key)


@pytest.mark.parametrize("name", DENSE)
def test_a_run_of_several_processes_is_the_run_of_one(store: Store, name: str) -> None:
    scene = DENSE[name]
    for _ in range(3):
        cut(store.path, scene)
    assert arrays_of(finished(store, scene)) == arrays_of(simulate(scene))
    assert not any((store.path / CHECKPOINTS).iterdir())
    assert store.check() == []


def test_files_are_those_of_a_run_in_memory(store: Store, tmp_path: Path) -> None:
    cut(store.path, LONG)
    key = Checkpoint(store.path, LONG, lambda: store.path).key
    finished(store, LONG)
    with Store.open(tmp_path / "other") as other:
        other.save(simulate(LONG))

    def members(path: Path) -> dict[str, bytes]:
        with ZipFile(path / "runs" / key / "zarr.zip") as file:
            assert len(set(file.namelist())) == len(file.namelist())
            return {name: file.read(name) for name in file.namelist() if name != "zarr.json"}

    assert members(store.path) == members(tmp_path / "other")


def test_what_a_checkpoint_does_not_count_is_removed_or_written_again(store: Store) -> None:
    cut(store.path, LONG)
    (first,) = directories(store.path, LONG)
    with RunStaging(store.path) as staging:
        _, checkpoint = begun(staging, LONG, 12)
        checkpoint.record.write()
        assert directories(store.path, LONG) == {first, staging.directory().name}
        store.recover()  # while that process lives
        assert directories(store.path, LONG) == {first, staging.directory().name}
    store.recover()
    assert directories(store.path, LONG) == {first}
    cut(store.path, LONG)
    (second,) = directories(store.path, LONG)  # what it has gone on from is its own now
    assert second != first
    assert arrays_of(finished(store, LONG)) == arrays_of(simulate(LONG))


def test_the_blocks_of_a_process_that_lives_are_its_own(store: Store) -> None:
    """Another one that makes the same run and is done before takes nothing away."""
    with RunStaging(store.path) as staging:
        simulation, checkpoint = begun(staging, LONG, 12)
        checkpoint.write(simulation.saved())
        finished(store, LONG)
        assert directories(store.path, LONG) == {staging.directory().name}
        staged = staging.stage_recorded(simulation.finish(), checkpoint.record)
        assert store.commit(staged) == checkpoint.key
    assert store.check() == []
    assert not any((store.path / CHECKPOINTS).iterdir())


def test_a_canceled_run_leaves_what_the_checkpoint_counts_only(store: Store) -> None:
    cut(store.path, LONG)
    (first,) = directories(store.path, LONG)
    simulation, checkpoint = begun(store, LONG, 12)
    checkpoint.record.write()
    checkpoint.leave()
    assert directories(store.path, LONG) == {first}
    simulation, checkpoint = begun(store, LONG, 12)
    checkpoint.write(simulation.saved())
    checkpoint.leave()
    assert len(directories(store.path, LONG)) == 1
    assert arrays_of(finished(store, LONG)) == arrays_of(simulate(LONG))


@pytest.mark.parametrize("damage", ["missing", "torn"])
def test_a_run_without_all_of_its_record_does_not_go_on(store: Store, damage: str) -> None:
    cut(store.path, LONG)
    checkpoint = store.checkpoint(LONG)
    (directory,) = checkpoint_path(store.path, checkpoint.key).with_suffix("").iterdir()
    path = sorted(directory.iterdir())[0]
    if damage == "missing":
        path.unlink()
    else:
        path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(StoreError, match="what it has recorded is damaged"):
        checkpoint.read()
    simulation = Simulation(LONG, sink=checkpoint.record)
    store.commit(store.stage_recorded(simulation.finish(), checkpoint.record))
    assert arrays_of(store.load(checkpoint.key)) == arrays_of(simulate(LONG))


def test_a_full_disk_costs_no_block(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", ROOM) as disk, Store.open(disk / "store") as store:
        simulation, checkpoint = begun(store, LONG, 5)
        with filled(disk):
            for _ in range(20):
                simulation.step()
            with pytest.raises(OSError, match="No space"):
                checkpoint.write(simulation.saved())
        checkpoint.write(simulation.saved())
        store.commit(store.stage_recorded(simulation.finish(), checkpoint.record))
        assert arrays_of(store.load(checkpoint.key)) == arrays_of(simulate(LONG))


def test_a_short_run_has_no_files_of_its_own(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    simulation, checkpoint = begun(store, PAIR, 0)
    results = simulation.finish()
    assert not (store.path / CHECKPOINTS).exists()
    store.commit(store.stage_recorded(results, checkpoint.record))
    assert not (store.path / CHECKPOINTS).exists()


def test_directories_of_others_stay(store: Store) -> None:
    cut(store.path, LONG)
    place = checkpoint_path(store.path, store.checkpoint(LONG).key).with_suffix("")
    foreign = place / "notes"
    foreign.mkdir()
    finished(store, LONG)
    shutil.rmtree(store.path / STAGING, ignore_errors=True)
    assert [path.name for path in place.iterdir()] == ["notes"]
