"""Single HDF5 files: exact, and whole at every moment."""

from __future__ import annotations

import os
import random
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from ensemble.store.hdf5 import export, read_hdf5, write_hdf5
from ensemble.store.run_record import RunSummary, arrays
from solver.analysis.run import Run
from tests.ensemble.runs import failed_run, shear_run

WRITER = """
import sys
from pathlib import Path
import numpy as np
from ensemble.store.hdf5 import write_hdf5
path, number = Path(sys.argv[1]), int(sys.argv[2])
while True:
    number += 1
    write_hdf5(path, {"state": np.full(500_000, float(number))}, {"number": number})
    print(number, flush=True)
"""


def test_arrays_and_attributes_come_back_exactly(tmp_path: Path) -> None:
    values = {
        "state": np.array([0.1, -0.0, np.nan, 5e-324]),
        "history": np.arange(24.0).reshape(2, 3, 4),
        "counts": np.array([1, 2**62]),
        "accepted": np.array([True, False]),
        "empty": np.empty((0, 3)),
        "scalar": np.array(0.3),
    }
    attributes = {"step": 0.1 + 0.2, "reason": None, "nested": {"order": [1, 2], "name": "δ"}, "count": 3}
    write_hdf5(tmp_path / "run.h5", values, attributes)
    read_values, read_attributes = read_hdf5(tmp_path / "run.h5")
    assert read_attributes == attributes
    assert read_values.keys() == values.keys()
    for name, array in values.items():
        assert (read_values[name].dtype, read_values[name].shape) == (array.dtype, array.shape)
        assert read_values[name].tobytes() == array.tobytes()


def test_attribute_may_exceed_64_kib(tmp_path: Path) -> None:
    attributes = {"scene": ["vesicle"] * 50_000}
    write_hdf5(tmp_path / "run.h5", {}, attributes)
    assert read_hdf5(tmp_path / "run.h5")[1] == attributes


def test_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    write_hdf5(path, {"state": np.ones(3)}, {})
    before = path.read_bytes()
    with pytest.raises(TypeError):
        write_hdf5(path, {"state": np.zeros(3)}, {"bad": object()})
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_file_is_whole_whenever_its_writer_is_killed(tmp_path: Path) -> None:
    path, partial = tmp_path / "run.h5", tmp_path / "run.h5.partial"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    moment = random.Random(5)
    acknowledged, torn = 0, 0
    for _ in range(8):
        command = [sys.executable, "-c", WRITER, str(path), str(acknowledged)]
        with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as writer:
            assert writer.stdout is not None
            first = writer.stdout.readline()
            time.sleep(moment.uniform(0, 0.05))
            deadline = time.monotonic() + 10
            while not partial.exists() and time.monotonic() < deadline:
                pass
            writer.kill()
            lines = (first + writer.stdout.read()).split()
        acknowledged = max(map(int, lines))
        torn += partial.exists()
        values, attributes = read_hdf5(path)
        # The last one may have been put in place without a word any more.
        assert attributes["number"] in (acknowledged, acknowledged + 1)
        assert values["state"].shape == (500_000,)
        assert (values["state"] == attributes["number"]).all()
    assert torn > 0, "no writer was killed in the middle of a write"
    write_hdf5(path, {}, {})
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("run", [shear_run(), failed_run()], ids=["shear", "failed"])
def test_export_holds_the_whole_run(tmp_path: Path, run: Run) -> None:
    summary = RunSummary.of(run)
    export(summary, run, tmp_path / "run.h5")
    values, attributes = read_hdf5(tmp_path / "run.h5")
    assert RunSummary.model_validate(attributes).document() == summary.document()
    assert {name: array.tobytes() for name, array in values.items()} == {
        name: array.values.tobytes() for name, array in arrays(run).items()
    }


def test_export_is_readable_without_this_package(tmp_path: Path) -> None:
    run = shear_run()
    export(RunSummary.of(run), run, tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["outcome"] == '"bound"'
        assert file["tangent_angle"].shape == run.frames.tangent_angle.shape
