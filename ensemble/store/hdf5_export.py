"""Export of a run to a single HDF5 file, laid out as netCDF-4."""

from __future__ import annotations

import json
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import h5netcdf

from ensemble.disk import write_durably
from ensemble.store.run_record import NamedArray, RunSummary


def write_netcdf(summary: RunSummary, arrays: Mapping[str, NamedArray], path: Path) -> None:
    """Write a run to a new file, or replace the file in one step.

    Each array is one variable, with a description and units, the stored ones with the names and dimensions
    that they have in the store; xarray opens the file with coordinates (``engine="h5netcdf"``).  Each field
    of the summary is one attribute of the root, as JSON text, so that None, nested fields and every bit of a
    float are kept.

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
    # Made in memory: the library cannot close a file of which the disk takes only a part.
    image = BytesIO()
    # Attributes beyond 64 KiB (a scene of many vesicles) need the 1.8 file format or later.
    with h5netcdf.File(image, "w", libver=("v108", "v110")) as file:
        for name, array in arrays.items():
            for dimension, size in zip(array.dimensions, array.values.shape, strict=True):
                if dimension not in file.dimensions:
                    file.dimensions[dimension] = size
            variable = file.create_variable(name, array.dimensions, data=array.values[:])
            variable.attrs.update(array.attributes)
        for name, value in summary.document().items():
            file.attrs[name] = json.dumps(value)
    write_durably(path, image.getbuffer())
