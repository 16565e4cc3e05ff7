"""The export of a run for ParaView: the layout that the format asks for, and what VTK makes of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from ensemble.store.exports import exported_arrays
from ensemble.store.run_record import NamedArray, RunSummary
from ensemble.store.vtk_export import write_vtkhdf
from tests.ensemble.runs import failed_run, shear_run

FRAMES, VESICLES, POINTS = 10, 2, 32


@pytest.fixture(scope="module")
def arrays() -> dict[str, NamedArray]:
    return exported_arrays(shear_run(), forces=True)


@pytest.fixture(scope="module")
def file(arrays: dict[str, NamedArray], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("vtk") / "run.vtkhdf"
    write_vtkhdf(RunSummary.of(shear_run()), arrays, path)
    return path


def places(arrays: dict[str, NamedArray]) -> NDArray[Any]:
    """Points of all membranes in each state, (frames, all points, 3)."""
    x, y = (arrays[name].values[:].reshape(FRAMES, -1) for name in ("x", "y"))
    return np.stack([x, y, np.zeros_like(x)], axis=-1)


def test_it_has_the_layout_of_transient_poly_data(file: Path, arrays: dict[str, NamedArray]) -> None:
    """After the specification, version 2.2."""
    size = VESICLES * POINTS
    with h5py.File(file) as opened:
        assert json.loads(opened.attrs["outcome"]) == "bound"
        root = opened["VTKHDF"]
        assert root.attrs["Type"] == b"PolyData"
        assert root.attrs["Version"].tolist() == [2, 2]
        assert root["NumberOfPoints"][:].tolist() == [size]
        np.testing.assert_array_equal(root["Points"][:].reshape(FRAMES, size, 3), places(arrays))
        lines = root["Lines"]
        assert lines["NumberOfCells"][:].tolist() == [VESICLES]
        assert lines["Offsets"][:].tolist() == [0, POINTS + 1, 2 * (POINTS + 1)]
        second = lines["Connectivity"][POINTS + 1 :]
        assert second.tolist() == [*range(POINTS, 2 * POINTS), POINTS]
        for name in ("Vertices", "Polygons", "Strips"):
            assert root[name]["NumberOfCells"][:].tolist() == [0]
            assert root[name]["Offsets"][:].tolist() == [0]
        steps = root["Steps"]
        assert steps.attrs["NSteps"] == FRAMES
        np.testing.assert_array_equal(steps["Values"][:], arrays["frame_time"].values[:])
        np.testing.assert_array_equal(steps["PointOffsets"][:], size * np.arange(FRAMES))
        assert steps["CellOffsets"].shape == steps["ConnectivityIdOffsets"].shape == (FRAMES, 4)
        assert steps["PointDataOffsets"].keys() == root["PointData"].keys()
        assert root["PointData/tension"].attrs["units"] == "R^-2 kappa"


def test_vtk_reads_what_was_written(file: Path, arrays: dict[str, NamedArray]) -> None:
    vtk = pytest.importorskip("vtk", reason="VTK is not installed")
    from vtk.util.numpy_support import vtk_to_numpy

    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(file))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == FRAMES
    for frame in range(FRAMES):
        reader.UpdateTimeStep(arrays["frame_time"].values[frame : frame + 1][0])
        read = reader.GetOutput()
        assert read.GetNumberOfLines() == VESICLES
        np.testing.assert_array_equal(vtk_to_numpy(read.GetPoints().GetData()), places(arrays)[frame])
        data = read.GetPointData()
        for name in ("tension", "bending_force", "adhesion_force"):
            values = vtk_to_numpy(data.GetArray(name))
            flat = values if values.ndim == 1 else values[:, :2]
            np.testing.assert_array_equal(flat.ravel(), arrays[name].values[frame : frame + 1].ravel())


def test_a_failed_run_is_written_too(tmp_path: Path) -> None:
    run = failed_run()
    write_vtkhdf(RunSummary.of(run), exported_arrays(run, forces=True), tmp_path / "run.vtkhdf")
    with h5py.File(tmp_path / "run.vtkhdf") as opened:
        assert np.isnan(opened["VTKHDF/PointData/tension"]).all()
