"""Arrays of a run as clients read them: diagnostics over time, and recorded states as points in the plane."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import BaseModel

from ensemble.errors import BadInput
from solver.analysis.run import Array, Run
from solver.membrane.curve import positions


class SeriesDocument(BaseModel):
    """Diagnostics over time by name; null where a value is not finite."""

    series: dict[str, list[float | None]]


class FramesDocument(BaseModel):
    """Recorded states: the points of the membranes in the plane and the tensions at these points.

    Attributes
    ----------
    index : (frames,)
        Number of each frame in the run.
    time : (frames,)
    position : (frames, vesicles, 2, points)
        x of all points, then y.
    tension : (frames, vesicles, points)
    total : int
        Number of frames of the run.
    """

    index: list[int]
    time: list[float | None]
    position: list[list[list[list[float | None]]]]
    tension: list[list[list[float | None]]]
    total: int


@dataclass(frozen=True)
class FrameSelection:
    """Some of the frames of a run, with positions in the plane.

    Attributes
    ----------
    index : list of int
        Number of each frame in the run.
    time : (frames,)
    position : (frames, vesicles, 2, points)
    tension : (frames, vesicles, points)
    total : int
        Number of frames of the run.
    """

    index: list[int]
    time: Array
    position: Array
    tension: Array
    total: int


def series_document(run: Run, names: Sequence[str]) -> SeriesDocument:
    """Return diagnostics of a run.

    Parameters
    ----------
    run : Run
    names : sequence of str
        Names of diagnostics; if it is empty, all are returned.

    Returns
    -------
    SeriesDocument

    Raises
    ------
    BadInput
        If the run has no diagnostic of a name.
    """
    unknown = set(names) - run.series.keys()
    if unknown:
        raise BadInput(f"name: {min(unknown)!r} — must be one of {', '.join(sorted(run.series))}")
    selected = sorted(set(names) or run.series.keys())
    return SeriesDocument(series={name: _finite_or_none(run.series[name]) for name in selected})


def select_frames(run: Run, numbers: range, maximum_values: int) -> FrameSelection:
    """Return frames of a run.

    Parameters
    ----------
    run : Run
    numbers : range
        Numbers of the frames; those that the run does not have are left out.
    maximum_values : int
        Largest number of values in the selected frames.

    Returns
    -------
    FrameSelection

    Raises
    ------
    BadInput
        If the frames hold more values; the message says how many frames are allowed.
    """
    frames, total = run.frames, len(run.frames.time)
    index = list(range(total)[numbers.start : numbers.stop : numbers.step])
    values_per_frame = 1 + 3 * math.prod(frames.tangent_angle.shape[1:])
    maximum_frames = max(maximum_values // values_per_frame, 1)
    if len(index) > maximum_frames:
        raise BadInput(
            f"stride: leaves {len(index)} frames — must leave at most {maximum_frames} of this run"
        )
    length = np.array([vesicle.length for vesicle in run.scene.vesicles])
    return FrameSelection(
        index=index,
        time=frames.time[index],
        position=positions(frames.tangent_angle[index], frames.center[index], length),
        tension=frames.tension[index],
        total=total,
    )


def frames_document(frames: FrameSelection) -> FramesDocument:
    """Return frames as JSON data.

    Parameters
    ----------
    frames : FrameSelection

    Returns
    -------
    FramesDocument
    """
    return FramesDocument(
        index=frames.index,
        time=_finite_or_none(frames.time),
        position=_finite_or_none(frames.position),
        tension=_finite_or_none(frames.tension),
        total=frames.total,
    )


def frames_bytes(frames: FrameSelection) -> bytes:
    """Return frames as little-endian float32, one frame after the other.

    Parameters
    ----------
    frames : FrameSelection

    Returns
    -------
    bytes
        For each frame its time, then for each vesicle x of all points, y of all points and the tensions at
        these points.
    """
    membranes = np.concatenate([frames.position, frames.tension[:, :, None, :]], axis=2)
    flat = membranes.reshape(len(frames.index), math.prod(membranes.shape[1:]))
    return np.column_stack([frames.time, flat]).astype("<f4").tobytes()


def _finite_or_none(values: Array) -> Any:
    """Return an array as nested lists, with None for values that JSON cannot write."""
    objects = values.astype(object)
    objects[~np.isfinite(values)] = None
    return objects.tolist()
