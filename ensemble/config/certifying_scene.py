"""The finer numerics at which the bracket of a critical value is certified."""

from __future__ import annotations

import math

from ensemble.config.validation import validated
from solver.scene import Numerics, Scene

# Errors in space fall exponentially with the number of points, those in time about as the tolerance.  Next to
# critical values of the default study a tenth of the tolerance does not always tell the side.  A hundredth
# does, in less than twice the time.
POINTS_FACTOR = 1.5
TOLERANCE_FACTOR = 100


def certifying_scene(scene: Scene) -> Scene:
    """Return the scene at the numerics that certify it.

    These have `POINTS_FACTOR` times as many points on a vesicle, an even number, and a tolerance in time
    `TOLERANCE_FACTOR` times smaller.  Where the tolerance chooses the points, the smaller one does: the
    numerics must follow from the scene alone, and not from how many points a run has ended with.

    Parameters
    ----------
    scene : Scene
        The scene at the numerics of the search.

    Returns
    -------
    Scene
        The same but for its numerics.

    Raises
    ------
    ValueError
        If that is finer than numerics can be; names the field and the allowed range.
    """
    numerics = scene.numerics
    points = numerics.points
    document = numerics.model_dump() | {
        "points": points if points == "auto" else 2 * math.ceil(points * POINTS_FACTOR / 2),
        "tolerance": numerics.tolerance / TOLERANCE_FACTOR,
    }
    try:
        return scene.model_copy(update={"numerics": validated(Numerics, document)})
    except ValueError as error:
        raise ValueError(f"to certify, numerics.{error}") from error


def can_be_certified(scene: Scene) -> bool:
    """Return whether there are finer numerics than those of a scene.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    bool
    """
    try:
        certifying_scene(scene)
    except ValueError:
        return False
    return True
