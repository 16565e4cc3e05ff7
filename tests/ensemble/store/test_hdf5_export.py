"""The export of a run to one HDF5 file: exact, and whole at every moment."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray

from ensemble.store.exports import exported_arrays
from ensemble.store.hdf5_export import write_netcdf
from ensemble.store.run_record import RunSummary, arrays
from solver.analysis.run import Run
from solver.scene import Vesicle
from tests.ensemble.runs import failed_run, shear_run, shear_scene

KILLED_EXPORTS = """
import os, random, signal, sys, time
from dataclasses import replace
from pathlib import Path
import numpy as np
from ensemble.store.exports import exported_arrays
from ensemble.store.hdf5_export import write_netcdf
from ensemble.store.run_record import RunSummary
from tests.ensemble.runs import shear_run, shear_scene
from tests.ensemble.store.test_hdf5_export import assert_whole
path, moment = Path(sys.argv[1]), random.Random(5)
run = shear_run(shear_scene(points=256), frames=500)
acknowledged, torn = 0, 0

def export_forever(number, acknowledgements):
    while True:
        number += 1
        frames = replace(run.frames, tension=np.full_like(run.frames.tension, number))
        numbered = replace(run, time=float(number), frames=frames)
        write_netcdf(RunSummary.of(numbered), exported_arrays(numbered), path)
        print(number, file=acknowledgements, flush=True)

def parts():
    return {entry for entry in path.parent.iterdir() if entry.name.startswith(".")}

for _ in range(8):
    earlier = parts()
    read, write = os.pipe()
    writer = os.fork()
    if writer == 0:
        with open(write, "w") as acknowledgements:
            export_forever(acknowledged, acknowledgements)
    os.close(write)
    with open(read) as lines:
        first = lines.readline()
        time.sleep(moment.uniform(0, 0.05))
        deadline = time.monotonic() + 10
        while not parts() - earlier and time.monotonic() < deadline:
            pass
        os.kill(writer, signal.SIGKILL)
        acknowledged = max(map(int, (first + lines.read()).split()))
    os.waitpid(writer, 0)
    torn += bool(parts() - earlier)
    assert_whole(path, acknowledged)
print(torn)
"""


def assert_whole(path: Path, acknowledged: int) -> None:
    """Check the file that a killed writer has left: the last export that it told of, or the next."""
    values, attributes = read(path)
    assert attributes["time"] in (acknowledged, acknowledged + 1)
    assert values["tension"].shape == (500, 2, 256)
    assert (values["tension"] == attributes["time"]).all()
    assert {entry for entry in path.parent.iterdir() if not entry.name.startswith(".")} == {path}


def read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Variables and attributes of a file by name, as HDF5 has them."""
    with h5py.File(path, "r") as file:
        return (
            {name: np.asarray(data[()]) for name, data in file.items() if not is_bare_dimension(data)},
            {name: json.loads(text) for name, text in file.attrs.items() if name != "_NCProperties"},
        )


def is_bare_dimension(data: h5py.Dataset) -> bool:
    """Whether a data set only stands for a dimension without coordinates."""
    return bytes(data.attrs.get("NAME", b"")).startswith(b"This is a netCDF dimension but not")


@pytest.mark.parametrize("run", [shear_run(), failed_run()], ids=["shear", "failed"])
def test_export_holds_the_whole_run(tmp_path: Path, run: Run) -> None:
    summary = RunSummary.of(run)
    write_netcdf(summary, exported_arrays(run), tmp_path / "run.h5")
    values, attributes = read(tmp_path / "run.h5")
    assert RunSummary.model_validate(attributes).document() == summary.document()
    assert values.keys() == arrays(run).keys() | {"x", "y"}
    for name, array in arrays(run).items():
        assert (values[name].dtype, values[name].shape) == (array.values.dtype, array.values.shape)
        assert values[name].tobytes() == array.values.tobytes()


def test_the_attributes_of_many_vesicles_exceed_64_kib(tmp_path: Path) -> None:
    vesicles = tuple(Vesicle(center=(3.0 * number, 0.0)) for number in range(600))
    run = shear_run(shear_scene().model_copy(update={"vesicles": vesicles}), frames=1)
    write_netcdf(RunSummary.of(run), exported_arrays(run), tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5") as file:
        assert len(file.attrs["scene"]) > 1 << 16
    assert read(tmp_path / "run.h5")[1]["scene"] == run.scene.model_dump(mode="json")


def test_export_is_readable_without_this_package(tmp_path: Path) -> None:
    run = shear_run()
    write_netcdf(RunSummary.of(run), exported_arrays(run), tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["outcome"] == '"bound"'
        assert file["tangent_angle"].shape == run.frames.tangent_angle.shape


def test_failed_export_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    run, path = shear_run(), tmp_path / "run.h5"
    write_netcdf(RunSummary.of(run), exported_arrays(run), path)
    before = path.read_bytes()
    unwritable = replace(run, series=run.series | {"gap": np.array([object()] * len(run.series["gap"]))})
    with pytest.raises(TypeError):
        write_netcdf(RunSummary.of(run), exported_arrays(unwritable), path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_file_is_whole_whenever_its_writer_is_killed(tmp_path: Path) -> None:
    killed = subprocess.run(
        [sys.executable, "-c", KILLED_EXPORTS, str(tmp_path / "run.h5")],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert killed.returncode == 0, killed.stderr
    assert int(killed.stdout) > 0, "no writer was killed in the middle of a write"


def test_xarray_opens_an_export_with_names_coordinates_and_units_and_writes_it_again(tmp_path: Path) -> None:
    run = shear_run()
    write_netcdf(RunSummary.of(run), exported_arrays(run), tmp_path / "run.h5")
    with xarray.open_dataset(tmp_path / "run.h5", engine="h5netcdf") as data:
        assert set(data.coords) == {"time", "frame_time", "x", "y"}
        assert data["gap"].dims == ("time",)
        assert data["tangent_angle"].dims == ("frame_time", "vesicle", "point")
        assert all(variable.attrs.keys() >= {"long_name", "units"} for variable in data.variables.values())
        np.testing.assert_array_equal(data["tension"].sel(frame_time=3.0), run.frames.tension[3])
        assert json.loads(data.attrs["outcome"]) == "bound"
        data.to_netcdf(tmp_path / "again.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "again.nc", engine="h5netcdf") as again:
        np.testing.assert_array_equal(again["gap"], run.series["gap"])
