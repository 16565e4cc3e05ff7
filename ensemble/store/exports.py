"""Files that other programs read: one file of a run, in the format that its suffix names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from ensemble.errors import BadInput
from ensemble.store.hdf5_export import write_netcdf
from ensemble.store.run_record import NamedArray, RunSummary, named_arrays
from ensemble.store.vtk_export import write_vtkhdf
from solver.membrane.curve import positions

if TYPE_CHECKING:
    from solver.analysis.run import Run

Writer = Callable[[RunSummary, Mapping[str, NamedArray], Path], None]

WRITERS: Final[Mapping[str, Writer]] = {
    ".h5": write_netcdf,
    ".hdf5": write_netcdf,
    ".nc": write_netcdf,
    ".vtkhdf": write_vtkhdf,
}


def writer_for(path: Path) -> Writer:
    """Return what writes a file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    callable
        Takes the summary of a run, its arrays and the path.

    Raises
    ------
    BadInput
        If its suffix names no format.
    """
    if path.suffix.lower() not in WRITERS:
        raise BadInput(f"file: {path.name!r} — must end in {', '.join(WRITERS)}")
    return WRITERS[path.suffix.lower()]


def exported_arrays(run: Run, forces: bool = False) -> dict[str, NamedArray]:
    """Return the arrays of a run for other programs: those that are stored, and what follows from them.

    Parameters
    ----------
    run : Run
    forces : bool
        Whether the forces by kind are computed, too.

    Returns
    -------
    dict of str to NamedArray
        As `ensemble.store.run_record.arrays`, with ``x`` and ``y`` of the points of the membranes and, on
        request, ``bending_force``, ``tension_force`` and ``adhesion_force``.
    """
    frames = run.frames
    lengths = np.array([vesicle.length for vesicle in run.scene.vesicles])
    points = positions(frames.tangent_angle, frames.center, lengths)
    derived = {"x": points[..., 0, :], "y": points[..., 1, :]}
    if forces:
        from solver.analysis.membrane_forces import membrane_forces  # loads compiled kernels

        by_kind = vars(membrane_forces(run.scene, frames))
        derived |= {f"{kind}_force": force for kind, force in by_kind.items() if force is not None}
    parts = {
        "series": run.series,
        "vesicle_series": run.vesicle_series,
        "frames": {field.name: getattr(frames, field.name) for field in fields(frames)} | derived,
    }
    named = named_arrays(parts, run.scene.units)
    at_points = {"coordinates": "x y"}  # by which programs find the places of values (CF conventions)
    for name, array in named.items():
        if "point" in array.dimensions and name not in ("x", "y"):
            named[name] = array._replace(attributes=array.attributes | at_points)
    return named
