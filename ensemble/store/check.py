"""What is wrong with a stored run, in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ensemble.config.run_key import run_key
from ensemble.errors import StoreError
from ensemble.store.archive import StoredArrays
from ensemble.store.run_record import RunSummary
from solver.analysis.run import Outcome, Run
from solver.revision import RESULTS_REVISION


def check_run(directory: Path, summary: RunSummary) -> list[str]:
    """Compare a run's group with its row in the catalog.

    Parameters
    ----------
    directory : Path
        The group, named by the run's key.
    summary : RunSummary
        What the catalog says.

    Returns
    -------
    list of str
        Problems, one sentence each; empty if there is none.
    """
    name = f"run {directory.name}"
    try:
        arrays = StoredArrays(directory)
        stored, run = arrays.summary, arrays.run()
    except StoreError as error:
        return [str(error)]
    problems = [f"{name}: {problem}" for problem in array_problems(run)]
    if stored.document() != summary.document():
        problems.append(f"{name}: its attributes differ from its row in the catalog")
    if summary.key != directory.name:
        problems.append(f"{name}: its row has the key {summary.key}")
    if summary.results_revision == RESULTS_REVISION and run_key(stored.scene) != stored.key:
        problems.append(f"{name}: its key is not that of its scene")
    return problems


def array_problems(run: Run) -> list[str]:
    """Compare the arrays of a run with what its summary says about them.

    Parameters
    ----------
    run : Run
        As it was read from its files.

    Returns
    -------
    list of str
        Problems, one clause each; empty if there is none.
    """
    frames = run.frames
    vesicles = len(run.scene.vesicles)
    points = run.work.points or run.scene.numerics.points  # records that lack the first have a fixed number
    times = frames.time.shape[:1]
    expected = {
        "frame_time": (frames.time, times),
        "tangent_angle": (frames.tangent_angle, (*times, vesicles, points)),
        "center": (frames.center, (*times, vesicles, 2)),
        "tension": (frames.tension, (*times, vesicles, points)),
    }
    if "time" not in run.series:
        return ["it has no array time"]
    samples = run.series["time"].shape[:1]
    expected |= {name: (values, samples) for name, values in run.series.items()}
    expected |= {
        name: (values, (*samples, vesicles, *values.shape[2:])) for name, values in run.vesicle_series.items()
    }
    problems = []
    for name, (values, shape) in expected.items():
        if values.shape != shape:
            problems.append(f"array {name} has shape {values.shape}, not {shape}")
        # A failed run may have failed because a value was not finite.
        elif run.outcome is not Outcome.FAILED and not np.isfinite(values).all():
            problems.append(f"array {name} holds values that are not finite")
    return problems
