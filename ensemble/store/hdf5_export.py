"""Export of a run to a single HDF5 file."""

from __future__ import annotations

import json
from pathlib import Path

import h5py

from ensemble.disk import flush, replacing
from ensemble.store.run_record import RunSummary, arrays
from solver.analysis.run import Run


def export_run(summary: RunSummary, run: Run, path: Path) -> None:
    """Write a run to a new file, or replace the file in one step.

    Each array is one data set, with the name that it has in the store.  Each field of the summary is one
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
    with replacing(path) as unfinished:
        # Attributes beyond 64 KiB (a scene of many vesicles) need the 1.8 file format or later.
        with h5py.File(unfinished, "w", libver=("v108", "v110")) as file:
            for name, array in arrays(run).items():
                file.create_dataset(name, data=array.values)
            for name, value in summary.document().items():
                file.attrs[name] = json.dumps(value)
        flush(unfinished)
    flush(path.parent)
