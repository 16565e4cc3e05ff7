"""A pair that a half turn about the origin leaves as it is needs only half the work.

All forces keep such a symmetry, and so do flows that are odd.  Then the second vesicle stays the image of the
first: its points are −x, its tangents −t and the forces on it −f.  Only the first is computed, as it moves
among both.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from solver.scene import Scene, Vesicle


def has_images(scene: Scene) -> bool:
    """Return whether a scene consists of a vesicle and its image.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    bool
    """
    if len(scene.vesicles) != 2 or (scene.flow is not None and not scene.flow.odd):
        return False
    first, second = scene.vesicles
    alike = second.model_copy(update={"center": first.center, "angle": first.angle}) == first
    opposite = all(a == -b for a, b in zip(first.center, second.center, strict=True))
    aligned = abs(math.remainder(first.angle - second.angle, math.pi)) < 1e-12  # ellipses
    return alike and opposite and aligned


def independent_vesicles(scene: Scene) -> tuple[Vesicle, ...]:
    """Return the vesicles that have to be computed: all, or those that are not images.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    tuple of Vesicle
    """
    return scene.vesicles[:1] if has_images(scene) else scene.vesicles
