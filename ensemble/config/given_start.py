"""Scenes that start from given shapes: those of a stored run at a time, or those in files.

A scene holds its shapes as numbers, not as the name of a file or the key of a run.  So it is whole: the same
on all ranks, in the service and in a store that is copied, and its key changes when a shape does.  References
are resolved once, here, when the scene is written.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ensemble.config.validation import validated
from solver.scene import Scene

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.analysis.run import Array, Frames
    from solver.membrane.traced_curve import TracedCurve


def nearest_frame(frames: Frames, time: float | None) -> int:
    """Return the index of the recorded state that is nearest to a time.

    Parameters
    ----------
    frames : Frames
    time : float or None
        None for the last state.

    Returns
    -------
    int

    Raises
    ------
    ValueError
        If the run has no such time, or its state there is not finite.
    """
    times = frames.time
    if time is not None and not times[0] <= time <= times[-1]:
        raise ValueError(f"time must be from {times[0]:g} to {times[-1]:g}, where the run has states")
    index = int(np.abs(times - (times[-1] if time is None else time)).argmin())
    if not (np.isfinite(frames.tangent_angle[index]).all() and np.isfinite(frames.center[index]).all()):
        raise ValueError(f"time: the state at {times[index]:g} is not finite")
    return index


def from_state(scene: Scene, tangent_angle: Array, center: Array) -> Scene:
    """Return a scene that starts from a state of its vesicles.

    Parameters
    ----------
    scene : Scene
    tangent_angle : (vesicles, points)
    center : (vesicles, 2)

    Returns
    -------
    Scene
    """
    shapes = [
        {"tangent_angle": angles.tolist(), "angle": 0.0, "center": place.tolist()}
        for angles, place in zip(tangent_angle, center, strict=True)
    ]
    return _with_shapes(scene, shapes)


def from_curves(scene: Scene, curves: Sequence[TracedCurve], scale: float) -> Scene:
    """Return a scene whose vesicles start as given curves.

    Parameters
    ----------
    scene : Scene
    curves : sequence of TracedCurve
        One for each vesicle.
    scale : float
        The unit of the curves in that of the scene.

    Returns
    -------
    Scene

    Raises
    ------
    ValueError
        If there are more or fewer than vesicles, or they overlap.
    """
    if len(curves) != len(scene.vesicles):
        raise ValueError(f"the scene has {len(scene.vesicles)} vesicles, and there are {len(curves)} files")
    return _with_shapes(
        scene,
        [
            {
                "tangent_angle": each.tangent_angle.tolist(),
                "angle": 0.0,
                "center": (scale * each.center).tolist(),
                "length": scale * each.length,
                "reduced_area": each.reduced_area,
            }
            for each in curves
        ],
    )


def turned_and_shifted(scene: Scene, turn: float, shift: tuple[float, float]) -> Scene:
    """Return a scene whose vesicles are turned about the mean of their centers, and then shifted.

    Parameters
    ----------
    scene : Scene
    turn : float
        Radians.
    shift : (2,)

    Returns
    -------
    Scene
    """
    if turn == 0 and shift == (0.0, 0.0):
        return scene
    centers = np.array([vesicle.center for vesicle in scene.vesicles])
    mean = centers.mean(axis=0)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    places = (centers - mean) @ rotation.T + mean + np.array(shift)
    vesicles = tuple(
        vesicle.model_copy(update={"angle": vesicle.angle + turn, "center": tuple(place.tolist())})
        for vesicle, place in zip(scene.vesicles, places, strict=True)
    )
    return scene.model_copy(update={"vesicles": vesicles})


def _with_shapes(scene: Scene, shapes: Sequence[dict[str, Any]]) -> Scene:
    """Return a scene with these fields of its vesicles, that starts with them as they are."""
    document = scene.model_dump(exclude={"start"})
    document["vesicles"] = [
        vesicle | shape for vesicle, shape in zip(document["vesicles"], shapes, strict=True)
    ]
    return validated(Scene, document)
