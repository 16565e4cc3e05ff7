"""The store: exact, and whole after any kill."""

from __future__ import annotations

import json
import os
import pickle
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
import pytest
import xarray
import zarr
from zarr.codecs import ZstdCodec
from zarr.storage import LocalStore, ZipStore

from ensemble.config.run_key import run_key
from ensemble.store import Store, StoreError, StoreInputError
from ensemble.store.listing import ParameterRange
from ensemble.store.run_record import RunSummary, arrays
from ensemble.store.written_arrays import read_written
from ensemble.store.zarr_groups import ARCHIVE
from solver.analysis.run import Outcome, Run
from solver.scene import Numerics
from solver.simulation.simulate import simulate
from tests.ensemble.group_files import unpack, unpacked
from tests.ensemble.runs import assert_same_run, failed_run, shear_run, shear_scene

PRELUDE = """
import sys
from pathlib import Path
from ensemble.store import Store
from tests.ensemble.runs import shear_run, shear_scene
def numbered_run(number):
    return shear_run(shear_scene(rate=1 + number / 128), seed=number)
"""

# One process that has imported everything forks a writer, kills it, and looks at what it left; twenty times.
# It forks to look, too, and so never starts a thread, which its children would lack.
KILL_WRITERS = """
import os, random, signal, time
import ensemble.store.archive
from ensemble.config.run_key import run_key
from ensemble.store.run_record import RunSummary

RunSummary.of(numbered_run(0))  # imports what runs need
path, acknowledged, torn, moment = Path(sys.argv[1]), [], 0, random.Random(11)

def save_forever(number, acknowledgements):
    with Store.open(path) as store:
        while True:
            store.save(numbered_run(number))
            print(number, file=acknowledgements, flush=True)
            number += 1

def look():
    with Store.open(path) as store:
        assert list((path / "staging").iterdir()) == []
        directories = {entry.name for entry in (path / "runs").iterdir()}
        assert directories == {summary.key for summary in store.summaries()}
        assert all(store.contains(run_key(numbered_run(number).scene)) for number in acknowledged)

def forked(function, *arguments):
    child = os.fork()
    if child:
        return child
    function(*arguments)
    os._exit(0)

for _ in range(20):
    # The run that was underway when the last writer was killed may or may not be there.
    number = max(acknowledged, default=-1) + 2
    read, write = os.pipe()
    with open(read) as lines:
        with open(write, "w") as acknowledgements:
            writer = forked(save_forever, number, acknowledgements)
        first = lines.readline()
        time.sleep(moment.uniform(0, 0.25))
        os.kill(writer, signal.SIGKILL)
        acknowledged += map(int, (first + lines.read()).split())
    os.waitpid(writer, 0)
    torn += any((path / "staging").glob("*/*.partial"))
    assert os.waitpid(forked(look), 0)[1] == 0
print(torn, *acknowledged)
"""

SAVE_AND_SWEEP = """
for number in range(int(sys.argv[2]), int(sys.argv[3])):
    with Store.open(Path(sys.argv[1])) as store:
        staged = store.stage(numbered_run(number))
        store.recover()
        store.commit(staged)
        print(number, flush=True)
"""

DIE_BEFORE_THE_CATALOG = """
import os, signal
from ensemble.store.catalog import Catalog
Catalog.insert = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
with Store.open(Path(sys.argv[1])) as store:
    store.save(numbered_run(0))
"""

STAGE_AND_WAIT = """
import pickle
with Store.open(Path(sys.argv[1])) as store:
    print(pickle.dumps(store.stage(numbered_run(0))).hex(), flush=True)
    sys.stdin.read()
"""


def numbered_run(number: int) -> Run:
    return shear_run(shear_scene(rate=1 + number / 128), seed=number)


def start(script: str, *arguments: object) -> subprocess.Popen[Any]:
    return subprocess.Popen(
        [sys.executable, "-c", PRELUDE + script, *map(str, arguments)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store.open(tmp_path / "store") as opened:
        yield opened


def run_directories(store: Store) -> set[str]:
    return {entry.name for entry in (store.path / "runs").iterdir()}


# Saving and loading


@pytest.mark.parametrize(
    "run",
    [
        shear_run(),
        failed_run(),
        shear_run(frames=0),
        shear_run(shear_scene(points=256), samples=3, frames=600),  # several chunks
    ],
    ids=["shear", "failed", "no frames", "several chunks"],
)
def test_run_comes_back_bit_for_bit(store: Store, run: Run) -> None:
    key = store.save(run)
    assert key == run_key(run.scene)
    assert_same_run(store.load(key), run)
    assert store.check() == []
    with Store.existing(store.path) as reopened:
        assert_same_run(reopened.load(key), run)


def test_a_run_whose_points_were_raised_comes_back(store: Store) -> None:
    """Its frames are checked against the number it ended with, which filters find, too."""
    scene = shear_scene().model_copy(update={"numerics": Numerics(points="auto"), "horizon": 8.0})
    run = simulate(scene)
    assert run.work.points
    assert run.work.points > 32
    store.save(run)
    assert_same_run(store.load(run_key(run.scene)), run)
    assert store.check() == []
    found = [store.summaries([where]) for where in ("numerics.points=auto", f"work.points={run.work.points}")]
    assert [[summary.key for summary in summaries] for summaries in found] == [[run_key(run.scene)]] * 2
    assert store.summaries(["numerics.points<64"]) == store.summaries(["numerics.points!=auto"]) == []


def test_frames_of_another_number_of_points_are_reported(store: Store) -> None:
    run = shear_run(shear_scene(points=32))
    store.save(replace(run, work=replace(run.work, points=48)))
    assert [problem.partition(" has shape ")[0] for problem in store.check()] == [
        f"run {run_key(run.scene)}: array {name}" for name in ("tangent_angle", "tension")
    ]


def test_long_arrays_are_stored_in_several_chunks(store: Store) -> None:
    key = store.save(shear_run(shear_scene(points=256), samples=3, frames=600))
    with ZipFile(store.path / "runs" / key / ARCHIVE) as archive:
        assert len([name for name in archive.namelist() if name.startswith("tension/c/")]) > 1


def test_a_run_is_one_file(store: Store) -> None:
    key = store.save(shear_run(shear_scene(points=256), samples=3, frames=600))
    assert [path.name for path in (store.path / "runs" / key).rglob("*")] == [ARCHIVE]


def write_as_before(directory: Path, run: Run, created: datetime) -> None:
    """Write a run as version 0.3 did: a file for each document and each chunk."""
    attributes = RunSummary.of(run).model_copy(update={"created": created}).document()
    group = zarr.create_group(LocalStore(directory), zarr_format=3, attributes=attributes)
    for name, array in arrays(run).items():
        group.create_array(
            name,
            data=array.values,
            chunks=tuple(max(length, 1) for length in array.values.shape),
            compressors=ZstdCodec(level=3, checksum=True),
            dimension_names=array.dimensions,
            fill_value=float("nan"),
            config={"write_empty_chunks": True},
        )


@pytest.mark.parametrize("run", [shear_run(), failed_run()], ids=["shear", "failed"])
def test_a_store_of_an_earlier_version_is_read_as_it_is(tmp_path: Path, run: Run) -> None:
    path = tmp_path / "store"
    Store.open(path).close()
    directory = path / "runs" / run_key(run.scene)
    write_as_before(directory, run, datetime(2025, 1, 2, tzinfo=UTC))
    before = {file: file.read_bytes() for file in directory.rglob("*") if file.is_file()}
    assert len(before) > 12
    with Store.open(path) as store:
        assert_same_run(store.load(directory.name), run)
        assert store.check() == []
        assert [summary.key for summary in store.summaries(["created<2025-01-03"])] == [directory.name]
        times = store.load(directory.name).frames.time
        assert np.array_equal(store.arrays(directory.name).rows("frame_time", range(1)), times[:1])
    assert before == {file: file.read_bytes() for file in directory.rglob("*") if file.is_file()}


def test_what_is_unpacked_is_what_earlier_versions_wrote(store: Store, tmp_path: Path) -> None:
    """But for the attributes of the arrays, which these did not have."""
    run = shear_run()
    directory = unpack(store.path / "runs" / store.save(run))
    write_as_before(tmp_path / "before", run, store.summary(directory.name).created)
    for metadata in directory.glob("*/zarr.json"):
        document = json.loads(metadata.read_text())
        assert document["attributes"].keys() == {"long_name", "units"}
        document["attributes"] = {}
        metadata.write_text(json.dumps(document, indent=2))
    found = [
        {str(file.relative_to(root)): file.read_bytes() for file in root.rglob("*") if file.is_file()}
        for root in (directory, tmp_path / "before")
    ]
    assert found[0] == found[1]


def test_xarray_opens_a_run_as_one_data_set(store: Store) -> None:
    run = shear_run()
    key = store.save(run)
    archive = ZipStore(store.path / "runs" / key / ARCHIVE, mode="r")
    with xarray.open_zarr(archive, consolidated=False) as data:
        assert set(data.coords) == {"time", "frame_time"}
        assert data["gap"].dims == ("time",)
        assert data["tangent_angle"].dims == ("frame_time", "vesicle", "point")
        assert data["center"].dims == ("frame_time", "vesicle", "axis")
        np.testing.assert_array_equal(data["tension"].sel(frame_time=3.0), run.frames.tension[3])
        np.testing.assert_array_equal(data["gap"].sel(time=2.5), run.series["gap"][10])
        assert data.attrs["outcome"] == "bound"
        assert data.attrs["scene"] == run.scene.model_dump(mode="json")


def test_summary_holds_every_scalar(store: Store) -> None:
    run = shear_run()
    before = datetime.now(UTC)
    key = store.save(run)
    summary = store.summary(key)
    assert store.summaries() == [summary]
    assert (summary.key, summary.scene, summary.outcome) == (key, run.scene, Outcome.BOUND)
    assert (summary.viscosity, summary.energy, summary.error) == (run.viscosity, run.energy, run.error)
    assert summary.wall_seconds == run.work.wall_seconds
    assert before <= summary.created <= datetime.now(UTC)
    assert {"vesicle-ensemble", "numpy", "scipy", "numba", "python"} <= summary.versions.keys()


def test_parameters_are_found_to_the_last_bit_and_only_within_their_ranges(store: Store) -> None:
    rates, hamakers = [0.1 + 0.2, 0.3, 1.0], [0.7, 1.01**37]
    for rate in rates:
        for hamaker in hamakers:
            store.save(shear_run(shear_scene(rate=rate, hamaker=hamaker)))
    store.save(failed_run())

    def found(*ranges: ParameterRange) -> set[tuple[float, ...]]:
        return set(store.parameters_within(*ranges))

    every = ParameterRange("flow.rate", 0.3, 1.0), ParameterRange("adhesion.hamaker", 0.7, 2.0)
    assert found(*every) == {(rate, hamaker) for rate in rates for hamaker in hamakers}
    assert found(ParameterRange("flow.rate", 0.5, 1.0), every[1]) == {(1.0, hamaker) for hamaker in hamakers}
    assert list(store.parameters_within(ParameterRange("vesicles.reduced_area", 0.9, 0.9))) == [(0.9,)]
    assert found(ParameterRange("vesicles.center.0", -2.0, 2.0)) == {(0.0,)}  # of the failed one: one vesicle


def test_unknown_run(store: Store) -> None:
    assert not store.contains("abc")
    assert store.answer("abc") is None
    for read in (store.load, store.summary):
        with pytest.raises(StoreInputError, match="no run abc"):
            read("abc")


def test_staging_alone_makes_nothing_exist(store: Store) -> None:
    staged = store.stage(shear_run())
    assert not store.contains(staged.key)
    assert store.summaries() == []
    assert store.commit(staged) == staged.key
    assert store.answer(staged.key) == (Outcome.BOUND, False, None)


def test_second_commit_of_a_key_keeps_the_first_run(store: Store) -> None:
    first, second = store.stage(shear_run(seed=1)), store.stage(shear_run(seed=2))
    assert store.commit(first) == store.commit(second) == store.commit(first)
    assert_same_run(store.load(first.key), shear_run(seed=1))
    assert not second.directory.exists()
    assert store.check() == []


def test_runs_committed_together_are_those_committed_one_by_one(store: Store) -> None:
    old = shear_run(shear_scene(0.5), seed=1)
    store.save(old)
    new = [shear_run(shear_scene(rate), seed=2) for rate in (0.5, 1.0, 1.5, 1.5)]
    staged = [store.stage(run) for run in new]
    store.commit_all(staged)
    assert {summary.key for summary in store.summaries()} == {each.key for each in staged}
    assert_same_run(store.load(staged[0].key), old)
    assert_same_run(store.load(staged[3].key), new[3])
    assert not any(each.directory.exists() for each in staged)
    assert store.check() == []


# Opening


def test_file_as_store_is_refused_and_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "results"
    path.write_text("mine")
    with pytest.raises(ValueError, match=r"^store: .*results is a file"):
        Store.open(path)
    with pytest.raises(ValueError, match=r"^store: "):
        Store.existing(path)
    with pytest.raises(ValueError, match=r"^store: "):
        Store.open(path / "inside")
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_text() == "mine"


def test_directory_of_something_else_never_becomes_a_store(tmp_path: Path) -> None:
    (tmp_path / "runs" / "precious").mkdir(parents=True)
    with pytest.raises(StoreInputError, match="already holds runs"):
        Store.open(tmp_path)
    assert list(tmp_path.rglob("*")) == [tmp_path / "runs", tmp_path / "runs" / "precious"]


def test_damaged_catalog_is_refused(tmp_path: Path) -> None:
    with Store.open(tmp_path / "store") as store:
        store.save(shear_run())
    (tmp_path / "store" / "catalog.sqlite").write_bytes(b"no database" * 1000)
    for opening in (Store.open, Store.existing):
        with pytest.raises(StoreInputError, match=r"^store: .*cannot be opened"):
            opening(tmp_path / "store")


def test_existing_creates_nothing(tmp_path: Path) -> None:
    with pytest.raises(StoreInputError, match="no store at"):
        Store.existing(tmp_path / "store")
    assert list(tmp_path.iterdir()) == []


# Being killed, and company


def test_kill_at_any_moment_loses_no_acknowledged_run(tmp_path: Path) -> None:
    path = tmp_path / "store"
    with start(KILL_WRITERS, path) as killer:
        printed = killer.communicate()[0]
    assert killer.returncode == 0
    torn, *acknowledged = map(int, printed.split())
    assert len(acknowledged) >= 20
    assert torn > 0, "no writer was killed in the middle of a run"
    with Store.existing(path) as store:
        assert store.check() == []
        for number in acknowledged:
            run = numbered_run(number)
            assert_same_run(store.load(run_key(run.scene)), run)


def test_two_processes_write_and_sweep_at_once(tmp_path: Path) -> None:
    path = tmp_path / "store"  # created by whichever comes first
    with start(SAVE_AND_SWEEP, path, 0, 16) as first, start(SAVE_AND_SWEEP, path, 8, 24) as second:
        printed = [process.communicate()[0] for process in (first, second)]
    assert (first.returncode, second.returncode) == (0, 0)
    assert [list(map(int, lines.split())) for lines in printed] == [list(range(16)), list(range(8, 24))]
    with Store.existing(path) as store:
        assert store.check() == []
        assert len(store.summaries()) == 24
        for number in range(24):
            run = numbered_run(number)
            assert_same_run(store.load(run_key(run.scene)), run)


def test_run_staged_by_another_process_is_committed_here(store: Store) -> None:
    with start(STAGE_AND_WAIT, store.path) as writer:
        assert writer.stdout is not None
        staged = pickle.loads(bytes.fromhex(writer.stdout.readline().decode()))
        store.recover()  # spares it: its writer lives
        assert store.check() == []
        key = store.commit(staged)
        writer.communicate()
    assert writer.returncode == 0
    assert_same_run(store.load(key), numbered_run(0))
    assert store.check() == []


def test_death_between_rename_and_catalog(store: Store) -> None:
    with start(DIE_BEFORE_THE_CATALOG, store.path) as writer:
        writer.communicate()
    assert writer.returncode == -signal.SIGKILL
    run = numbered_run(0)
    key = run_key(run.scene)
    assert run_directories(store) == {key}
    assert not store.contains(key)
    assert store.summaries() == []
    assert store.check() == [f"run {key}: it is in runs/ and not in the catalog"]

    shutil.copytree(store.path, store.path.with_name("copy"))
    with Store.open(store.path.with_name("copy")) as recovered:
        assert_same_run(recovered.load(key), run)
        assert recovered.check() == []

    (store.path / "runs" / key / ARCHIVE).write_text("torn")
    assert store.save(run) == key
    assert_same_run(store.load(key), run)


def test_closing_keeps_whole_runs_and_removes_what_was_not_finished(tmp_path: Path) -> None:
    path = tmp_path / "store"
    with Store.open(path) as store:
        store.commit(store.stage(shear_run()))
    assert list((path / "staging").iterdir()) == []
    with Store.open(path) as store:
        key = store.stage(numbered_run(1)).key
    with Store.open(path) as store:
        assert_same_run(store.load(key), numbered_run(1))
        assert list((path / "staging").iterdir()) == []


# Checking


def flip_a_bit(run: Path) -> None:
    chunk = run / "tangent_angle" / "c" / "0" / "0" / "0"
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 1
    chunk.write_bytes(data)


def truncate_a_chunk(run: Path) -> None:
    chunk = run / "gap" / "c" / "0"
    chunk.write_bytes(chunk.read_bytes()[:-3])


def change_attribute(run: Path) -> None:
    metadata = json.loads((run / "zarr.json").read_text())
    metadata["attributes"]["gap"] = 0.25
    (run / "zarr.json").write_text(json.dumps(metadata))


def shorten_an_array(run: Path) -> None:
    metadata = json.loads((run / "gap" / "zarr.json").read_text())
    metadata["shape"] = [39]
    (run / "gap" / "zarr.json").write_text(json.dumps(metadata))


Layout = Callable[[Path], AbstractContextManager[Path]]


@pytest.mark.parametrize(
    "layout", [unpacked, lambda directory: nullcontext(unpack(directory))], ids=["archive", "files"]
)
@pytest.mark.parametrize(
    ("damage", "problem"),
    [
        (flip_a_bit, "tangent_angle cannot be decoded"),
        (truncate_a_chunk, "gap cannot be decoded"),
        (lambda run: (run / "tension" / "c" / "0" / "0" / "0").unlink(), "tension has lost 1 of 1 chunks"),
        (lambda run: shutil.rmtree(run / "center"), "center is missing"),
        (lambda run: shutil.rmtree(run / "gap"), "gap is missing"),
        (lambda run: (run / "zarr.json").write_text("{"), "no readable group"),
    ],
)
def test_damage_is_reported_and_never_read(
    store: Store, layout: Layout, damage: Callable[[Path], object], problem: str
) -> None:
    whole, damaged = store.save(numbered_run(0)), store.save(numbered_run(1))
    with layout(store.path / "runs" / damaged) as files:
        damage(files)
    problems = store.check()
    assert len(problems) == 1
    assert damaged in problems[0]
    assert problem in problems[0]
    with pytest.raises(StoreError, match=problem):
        store.load(damaged)
    assert_same_run(store.load(whole), numbered_run(0))


@pytest.mark.parametrize(
    ("damage", "problem"),
    [(change_attribute, "differ from its row"), (shorten_an_array, "gap has shape (39,), not (40,)")],
)
def test_inconsistency_is_reported(store: Store, damage: Callable[[Path], object], problem: str) -> None:
    key = store.save(shear_run())
    with unpacked(store.path / "runs" / key) as files:
        damage(files)
    (reported,) = store.check()
    assert problem in reported


def test_values_that_are_not_finite_are_reported_unless_the_run_failed(store: Store) -> None:
    run = shear_run()
    run.frames.tension[2, 0, 5] = np.nan
    store.save(run)
    store.save(failed_run())
    (problem,) = store.check()
    assert "tension holds values that are not finite" in problem


def test_arrays_are_read_directly_as_they_are_written_and_equal_those_of_zarr(tmp_path: Path) -> None:
    long = shear_run(samples=300_000, frames=3)  # of series with several chunks
    with Store.open(tmp_path / "store") as store:
        for run in (long, failed_run()):
            key = store.save(run)
            archive = store.path / "runs" / key / ARCHIVE
            with ZipFile(archive) as file, closing(ZipStore(archive)) as zarr_store:
                group = zarr.open_group(zarr_store, mode="r")
                for name in group.array_keys():
                    values = read_written(file, name)
                    assert values is not None, name
                    np.testing.assert_array_equal(values, group[name][...], strict=True)
