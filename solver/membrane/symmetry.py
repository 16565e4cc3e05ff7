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

_ROUND_OFF = 1e-12  # radians


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
    if scene.start.deformation is not None:
        return False  # each has its own
    first, second = scene.vesicles
    placed = {"center": first.center, "angle": first.angle, "tangent_angle": first.tangent_angle}
    alike = second.model_copy(update=placed) == first
    opposite = all(a == -b for a, b in zip(first.center, second.center, strict=True))
    return alike and opposite and _half_a_turn_apart(first, second)


def _half_a_turn_apart(first: Vesicle, second: Vesicle) -> bool:
    """Return whether a half turn makes the shape of one vesicle that of the other, to round-off."""
    if first.tangent_angle is None and second.tangent_angle is None:
        return abs(math.remainder(first.angle - second.angle, math.pi)) < _ROUND_OFF  # ellipses
    shapes = first.tangent_angle or (), second.tangent_angle or ()
    turn = second.angle - first.angle - math.pi
    return len(shapes[0]) == len(shapes[1]) and all(
        abs(math.remainder(b - a + turn, 2 * math.pi)) < _ROUND_OFF for a, b in zip(*shapes, strict=True)
    )


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
