"""Export of a run to a single HDF5 file, laid out as netCDF-4."""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path

import h5netcdf

from ensemble.disk import flush, replacing
from ensemble.store.run_record import RunSummary, arrays
from solver.analysis.run import Run


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
            variable = file.create_variable(name, array.dimensions, data=array.values[:])
            variable.attrs.update(array.attributes)
        for name, value in summary.document().items():
            file.attrs[name] = json.dumps(value)
    with replacing(path) as unfinished:
        unfinished.write_bytes(image.getbuffer())
        flush(unfinished)
    flush(path.parent)
