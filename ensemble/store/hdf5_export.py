"""Export of a run to a single HDF5 file, laid out as netCDF-4."""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path

import h5netcdf

from ensemble.disk import flush, replacing
from ensemble.store.run_record import RunSummary, arrays
from solver.analysis.run import Run

# The fluid outside has viscosity 1.  R is the length of a vesicle over 2π, kappa its bending modulus.
_TIME, _LENGTH, _ANGLE, _NUMBER = "mu R^3 kappa^-1", "R", "radian", "1"
_ENERGY, _TENSION = "kappa R^-1", "kappa R^-2"
_DESCRIPTIONS = {
    "time": ("time of the diagnostics", _TIME),
    "frame_time": ("time of the recorded states", _TIME),
    "tangent_angle": ("tangent angle of the membranes, by equal arclength", _ANGLE),
    "center": ("centers of the membranes", _LENGTH),
    "tension": ("membrane tension", _TENSION),
    "bending_energy": ("bending energy of all vesicles", _ENERGY),
    "adhesion_energy": ("adhesion energy of all pairs", _ENERGY),
    "area_error": ("largest relative drift of a vesicle's area", _NUMBER),
    "closure_error": ("largest gap in a membrane over its length", _NUMBER),
    "state_rate": ("largest rate of change of a tangent angle or center", "mu^-1 R^-3 kappa"),
    "gap": ("smallest distance between two membranes", _LENGTH),
    "center_distance": ("distance of the two centers", _LENGTH),
    "center_angle": ("angle of the line of centers, unwrapped", _ANGLE),
    "inclination_angle": ("angle of the long axis against x", _ANGLE),
    "viscosity_bending_tension": ("intrinsic viscosity by bending and tension", _NUMBER),
    "viscosity_adhesion": ("intrinsic viscosity by adhesion", _NUMBER),
    "viscosity_contrast": ("intrinsic viscosity by the viscosity contrast", _NUMBER),
    "clusters": ("number of clusters", _NUMBER),
    "largest_cluster": ("vesicles in the largest cluster", _NUMBER),
    "vesicle_center": ("center of each vesicle", _LENGTH),
    "vesicle_inclination_angle": ("angle of each long axis against x", _ANGLE),
    "vesicle_area_error": ("relative drift of each area", _NUMBER),
    "vesicle_cluster": ("number of the cluster of each vesicle", _NUMBER),
}


def export_run(summary: RunSummary, run: Run, path: Path) -> None:
    """Write a run to a new file, or replace the file in one step.

    Each array is one variable, with the name and the dimensions that it has in the store, a description and
    units; xarray opens the file with coordinates (``engine="h5netcdf"``).  Each field of the summary is one
    attribute of the root, as JSON text, so that None, nested fields and every bit of a float are kept.

    Parameters
    ----------
    summary : RunSummary
        Everything about the run except its arrays.
    run : Run
        The run.
    path : Path
        The file to write.  It is durable when this function returns.

    Raises
    ------
    OSError
        If the file cannot be written.  An earlier file is then unchanged.
    """
    # Made in memory: the library cannot close a file of which the disk takes only a part.
    image = BytesIO()
    # Attributes beyond 64 KiB (a scene of many vesicles) need the 1.8 file format or later.
    with h5netcdf.File(image, "w", libver=("v108", "v110")) as file:
        for name, array in arrays(run).items():
            for dimension, size in zip(array.dimensions, array.values.shape, strict=True):
                if dimension not in file.dimensions:
                    file.dimensions[dimension] = size
            variable = file.create_variable(name, array.dimensions, data=array.values)
            if name in _DESCRIPTIONS:
                variable.attrs["long_name"], variable.attrs["units"] = _DESCRIPTIONS[name]
        for name, value in summary.document().items():
            file.attrs[name] = json.dumps(value)
    with replacing(path) as unfinished:
        unfinished.write_bytes(image.getbuffer())
        flush(unfinished)
    flush(path.parent)
