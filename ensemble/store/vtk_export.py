"""Export of a run to VTKHDF, the HDF5 format of VTK and ParaView: membranes as lines that move with time.

The file holds transient poly data, version 2.2 of the format (https://docs.vtk.org, "VTKHDF file format").
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import h5py
import numpy as np

from ensemble.disk import write_durably
from ensemble.store.run_record import NamedArray, RunSummary
from solver.analysis.run import Array

_VERSION = (2, 2)
_TOPOLOGIES = ("Vertices", "Lines", "Polygons", "Strips")  # in this order; all but lines are empty
_POINTS = ("frame_time", "vesicle", "point")


def write_vtkhdf(summary: RunSummary, arrays: Mapping[str, NamedArray], path: Path) -> None:
    """Write the recorded states of a run to a new file, or replace the file in one step.

    Each membrane is a closed line.  What is known at its points, such as ``tension``, is point data, vectors
    with a third component of 0; ``vesicle`` is its number, cell data.  Steps have the times of the states.
    The fields of the summary are attributes of the file, as JSON text.

    Parameters
    ----------
    summary : RunSummary
        Everything about the run except its arrays.
    arrays : mapping of str to NamedArray
        As `ensemble.store.exports.exported_arrays` returns them.
    path : Path
        The file to write.  It is durable when this function returns.

    Raises
    ------
    OSError
        If the file cannot be written.  An earlier file is then unchanged.
    """
    image = BytesIO()
    with h5py.File(image, "w", libver=("v108", "v110")) as file:
        for name, value in summary.document().items():
            file.attrs[name] = json.dumps(value)
        root = file.create_group("VTKHDF", track_order=True)
        root.attrs["Version"] = _VERSION
        root.attrs.create("Type", b"PolyData", dtype=h5py.string_dtype("ascii", len(b"PolyData")))
        _write_states(root, {name: array for name, array in arrays.items() if _is_at_points(array)}, arrays)
    write_durably(path, image.getbuffer())


def _is_at_points(array: NamedArray) -> bool:
    return array.dimensions[:3] == _POINTS


def _write_states(
    root: h5py.Group, at_points: Mapping[str, NamedArray], arrays: Mapping[str, NamedArray]
) -> None:
    """Write the points and what is known there, one state after the other, and the steps."""
    times = arrays["frame_time"].values[:]
    states, vesicles, points = arrays["x"].values.shape
    placed = np.stack([at_points["x"].values[:], at_points["y"].values[:]], axis=-1)
    root["NumberOfPoints"] = [vesicles * points]  # of the one part that all steps have
    root["Points"] = _in_space(placed)
    _write_topologies(root, vesicles, points)
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = states
    first_points = np.arange(states) * vesicles * points
    steps["Values"], steps["PointOffsets"] = times, first_points
    steps["PartOffsets"], steps["NumberOfParts"] = np.zeros(states, dtype=int), np.ones(states, dtype=int)
    for name in ("CellOffsets", "ConnectivityIdOffsets"):  # the same lines in every step
        steps[name] = np.zeros((states, len(_TOPOLOGIES)), dtype=int)
    for name, array in at_points.items():
        if name not in ("x", "y"):
            values = array.values[:]
            root[f"PointData/{name}"] = values.ravel() if values.ndim == len(_POINTS) else _in_space(values)
            root[f"PointData/{name}"].attrs.update(array.attributes)
            steps[f"PointDataOffsets/{name}"] = first_points
    root["CellData/vesicle"] = np.arange(vesicles)
    steps["CellDataOffsets/vesicle"] = np.zeros(states, dtype=int)


def _in_space(vectors: Array) -> Array:
    """Return vectors (..., 2) as (all, 3)."""
    flat = vectors.reshape(-1, 2)
    return np.column_stack([flat, np.zeros(len(flat))])


def _write_topologies(root: h5py.Group, vesicles: int, points: int) -> None:
    """Write the cells: a line around each membrane, which ends at its first point."""
    numbers = np.arange(vesicles * points).reshape(vesicles, points)
    closed = np.column_stack([numbers, numbers[:, 0]])
    for name in _TOPOLOGIES:
        lines = closed if name == "Lines" else closed[:0]
        group = root.create_group(name)
        group["NumberOfConnectivityIds"], group["NumberOfCells"] = [lines.size], [len(lines)]
        group["Connectivity"] = lines.ravel()
        group["Offsets"] = np.arange(len(lines) + 1) * closed.shape[1]
