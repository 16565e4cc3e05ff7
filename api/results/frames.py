"""Recorded states of a run as a client draws them: points in the plane and the tension there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from api.http.schemas import FramesDocument
from api.results.series import finite_or_none
from ensemble.errors import BadInput
from solver.analysis.run import Array, Run
from solver.membrane.curve import positions


@dataclass(frozen=True)
class States:
    """Chosen frames of a run.

    index, time : (frames,)
    position : (frames, vesicles, 2, points)
    tension : (frames, vesicles, points)
    total : number of frames that the run has.
    """

    index: list[int]
    time: Array
    position: Array
    tension: Array
    total: int


def select_frames(run: Run, start: int, stop: int, stride: int, most_values: int) -> States:
    """Choose every `stride`-th frame from `start` up to, not including, `stop`.

    Raises
    ------
    BadInput
        If they hold more than `most_values` numbers; says how many frames may be asked for at once.
    """
    frames, total = run.frames, len(run.frames.time)
    chosen = list(range(total)[start:stop:stride])
    values_each = 1 + 3 * math.prod(frames.tangent_angle.shape[1:])
    most_frames = max(most_values // values_each, 1)
    if len(chosen) > most_frames:
        raise BadInput(f"stride: leaves {len(chosen)} frames — must leave at most {most_frames} of this run")
    length = np.array([vesicle.length for vesicle in run.scene.vesicles])
    return States(
        index=chosen,
        time=frames.time[chosen],
        position=positions(frames.tangent_angle[chosen], frames.center[chosen], length),
        tension=frames.tension[chosen],
        total=total,
    )


def frames_document(states: States) -> FramesDocument:
    """Write states as JSON data."""
    return FramesDocument(
        index=states.index,
        time=finite_or_none(states.time),
        position=finite_or_none(states.position),
        tension=finite_or_none(states.tension),
        total=states.total,
    )


def frames_bytes(states: States) -> bytes:
    """Write states as little-endian float32, frame after frame.

    A frame is its time and then, for each vesicle, x of all points, y of all points and the tensions there.
    """
    membranes = np.concatenate([states.position, states.tension[:, :, None, :]], axis=2)
    flat = membranes.reshape(len(states.index), math.prod(membranes.shape[1:]))
    return np.column_stack([states.time, flat]).astype("<f4").tobytes()
