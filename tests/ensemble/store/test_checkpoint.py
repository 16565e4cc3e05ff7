"""Checkpoints: what is read has the bits and the types of what was written, and only what fits is used.

About 15 s of processor time."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from ensemble.config.checkpoint_interval import CHECKPOINT_SECONDS, checkpoint_seconds
from ensemble.config.run_key import run_key
from ensemble.errors import BadInput, StoreError
from ensemble.store import RunStaging, Store
from ensemble.store.checkpoint import checkpoint_path
from ensemble.store.plain_hdf5 import read_plain, write_plain
from ensemble.store.repair import repair
from solver import RESULTS_REVISION, Simulation, simulate
from solver.integrators.integrator import FACTORIES
from solver.memory import Saved
from solver.scene import Scene
from tests.full_disks import ENTRIES, ROOM, filled, small_disk
from tests.solver.restarts import PAIR, SCENES, arrays_of, numerics, restarted


def typed(value: Any) -> Any:
    """A value with all of its types, layouts and bits, to compare."""
    if isinstance(value, np.ndarray):
        layout = (value.flags.c_contiguous, value.flags.f_contiguous)
        return (value.dtype.str, value.shape, layout, value.tobytes())
    if isinstance(value, np.generic):
        return (value.dtype.str, value.tobytes())
    if isinstance(value, dict):
        return [(key, typed(each)) for key, each in value.items()]
    if isinstance(value, list | tuple):
        return (type(value).__name__, [typed(each) for each in value])
    return (type(value).__name__, repr(value))


VALUES = {
    "scalars": [None, True, 3, -0.0, 1e-300, float("nan"), float("inf"), "σ"],
    "scalars of NumPy": [np.float64(0.1), np.bool_(True), np.int64(-7), np.float64("nan")],
    "series": {"of floats": [0.1, 0.2], "of NumPy's": [np.float64(0.1)] * 3, "mixed": [0.1, np.float64(0.1)]},
    "tuples": (1, (2.5, [np.float64(2.5), None], ()), [], {}),
    "layouts": [
        np.arange(12.0).reshape(3, 4),
        np.asfortranarray(np.arange(12.0).reshape(3, 4)),
        np.arange(24.0).reshape(2, 3, 4).T,
        np.arange(12.0)[::2],
    ],
    "shapes": [np.float64(1.0) * np.ones(()), np.ones((0, 3)), np.ones(1), np.array([True, False])],
    "integers": np.arange(5),
    "no strings": {1: "one", ("a", 2): "two"},
}


@pytest.mark.parametrize("name", VALUES)
def test_a_value_comes_back(tmp_path: Path, name: str) -> None:
    write_plain(tmp_path / "value.h5", VALUES[name], {})
    expected = pickle.loads(pickle.dumps(VALUES[name]))  # which makes what is not contiguous so
    assert typed(read_plain(tmp_path / "value.h5")) == typed(expected)


def test_what_is_no_plain_value_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="set"):
        write_plain(tmp_path / "value.h5", {"a": {1, 2}}, {})


@pytest.fixture
def staging(tmp_path: Path) -> Iterator[RunStaging]:
    Store.open(tmp_path / "store").close()
    with RunStaging(tmp_path / "store") as opened:
        yield opened


def state_after(scene: Scene, steps: int) -> Saved:
    simulation = Simulation(scene)
    for _ in range(steps):
        simulation.step()
    return simulation.saved()


@pytest.mark.parametrize("name", SCENES)
def test_a_run_that_goes_on_from_files_has_the_same_bits(staging: RunStaging, name: str) -> None:
    require_same_bits(staging, SCENES[name], every=7)


@pytest.mark.parametrize("integrator", FACTORIES)
def test_every_registered_integrator(staging: RunStaging, integrator: str) -> None:
    chosen = numerics(integrator=integrator)
    require_same_bits(staging, PAIR.model_copy(update={"numerics": chosen, "horizon": 1.5}), every=4)


def test_step_control_by_area_and_length(staging: RunStaging) -> None:
    chosen = numerics(integrator="sdc", step_control="area-length", tolerance=1e-2)
    require_same_bits(staging, PAIR.model_copy(update={"numerics": chosen, "horizon": 1.0}), every=3)


def require_same_bits(staging: RunStaging, scene: Scene, every: int) -> None:
    checkpoint = staging.checkpoint(scene)

    def written(saved: Saved) -> Saved:
        checkpoint.write(saved)
        read = checkpoint.read()
        assert typed(read) == typed(pickle.loads(pickle.dumps(saved)))
        assert read is not None
        return read

    assert arrays_of(restarted(scene, every, written)) == arrays_of(simulate(scene))


def test_there_is_none_at_first(staging: RunStaging) -> None:
    assert staging.checkpoint(PAIR).read() is None


def test_one_that_is_cut_short_or_has_a_flipped_bit_is_not_read(staging: RunStaging) -> None:
    checkpoint, path = staging.checkpoint(PAIR), checkpoint_path(staging.path, run_key(PAIR))
    checkpoint.write(state_after(PAIR, 5))
    whole = path.read_bytes()
    damaged = [whole[: len(whole) // 2], b"", b"no HDF5"]
    with h5py.File(path) as file:
        for name in ("structure", "numbers/float64"):
            place = file[name].id.get_chunk_info(0).byte_offset
            damaged.append(whole[: place + 9] + bytes([whole[place + 9] ^ 1]) + whole[place + 10 :])
    for contents in damaged:
        path.write_bytes(contents)
        with pytest.raises(StoreError, match="damaged"):
            checkpoint.read()
    checkpoint.write(state_after(PAIR, 6))
    assert checkpoint.read() is not None


def test_one_of_another_run_or_revision_is_not_read(staging: RunStaging) -> None:
    checkpoint, path = staging.checkpoint(PAIR), checkpoint_path(staging.path, run_key(PAIR))
    checkpoint.write(state_after(PAIR, 5))
    for name, value in (("key", "0" * 32), ("results_revision", RESULTS_REVISION + 1)):
        with h5py.File(path, "r+") as file:
            kept, file.attrs[name] = file.attrs[name], value
        with pytest.raises(StoreError, match=f"it has the {name} {value}"):
            checkpoint.read()
        with h5py.File(path, "r+") as file:
            file.attrs[name] = kept
    assert checkpoint.read() is not None
    earlier = checkpoint_path(staging.path, run_key(PAIR, RESULTS_REVISION - 1))
    path.rename(earlier)
    with pytest.raises(StoreError, match=f"has the results_revision {RESULTS_REVISION - 1}.* is removed"):
        checkpoint.read()
    assert not earlier.exists()
    assert checkpoint.read() is None


@pytest.mark.parametrize("option", [ROOM, ENTRIES])
def test_a_disk_that_does_not_take_it_leaves_the_one_before(tmp_path: Path, option: str) -> None:
    with small_disk(tmp_path / "disk", option) as disk:
        Store.open(disk / "store").close()
        with RunStaging(disk / "store") as staging:
            checkpoint = staging.checkpoint(PAIR)
            checkpoint.write(state_after(PAIR, 5))
            before = typed(checkpoint.read())
            later = state_after(PAIR, 6)
            with filled(disk), pytest.raises(OSError, match="No space"):
                checkpoint.write(later)
            assert typed(checkpoint.read()) == before
            assert [path.name for path in staging.directory().iterdir()] == ["writer.lock"]
            checkpoint.write(later)
            assert typed(checkpoint.read()) == typed(pickle.loads(pickle.dumps(later)))


def test_a_commit_removes_it(tmp_path: Path) -> None:
    scene = PAIR.model_copy(update={"horizon": 0.1})
    path = checkpoint_path(tmp_path / "store", run_key(scene))
    with Store.open(tmp_path / "store") as store:
        store.checkpoint(scene).write({"a": 1})
        assert path.exists()
        store.save(simulate(scene))
        assert not path.exists()
        store.checkpoint(scene).write({"a": 1})
        store.save(simulate(scene))  # which the store has already
        assert not path.exists()
        store.checkpoint(scene).write({"a": 1})
    Store.open(tmp_path / "store").close()  # as after a process that died before it could remove it
    assert not path.exists()


def test_checks_and_repairs_leave_those_of_runs_in_progress(staging: RunStaging) -> None:
    checkpoint = staging.checkpoint(PAIR)
    checkpoint.write({"a": 1})
    foreign = checkpoint_path(staging.path, "notes")
    foreign.write_text("of somebody")
    with Store.open(staging.path) as store:
        assert store.check() == []
    assert repair(staging.path) == []
    assert checkpoint.read() == {"a": 1}
    assert foreign.exists()


def test_the_interval_is_a_setting() -> None:
    assert checkpoint_seconds({}) == 60.0
    assert checkpoint_seconds({CHECKPOINT_SECONDS: "0.5"}) == 0.5
    for text in ("0", "-1", "nan", "1e9", "often"):
        with pytest.raises(BadInput, match=f"{CHECKPOINT_SECONDS}: '{text}' — must be"):
            checkpoint_seconds({CHECKPOINT_SECONDS: text})
