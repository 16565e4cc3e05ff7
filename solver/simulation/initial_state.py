"""The state in which a run begins."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.membrane.geometry import Membranes
from solver.membrane.shapes import ellipse_tangent_angle, of_reduced_area
from solver.membrane.symmetry import independent_vesicles

if TYPE_CHECKING:
    from solver.scene import Scene

Array = NDArray[np.float64]


def initial_ellipses(scene: Scene) -> Array:
    """Return the state of ellipses where the scene places its vesicles.

    Parameters
    ----------
    scene : Scene
        With a number of points.

    Returns
    -------
    (state_size,)
    """
    vesicles, membranes = independent_vesicles(scene), Membranes.of_scene(scene)
    tangent_angle = [
        of_reduced_area(
            ellipse_tangent_angle(vesicle.reduced_area, vesicle.length, vesicle.angle, membranes.points),
            vesicle.reduced_area,
        )
        for vesicle in vesicles
    ]
    center = [vesicle.center for vesicle in vesicles]
    return membranes.pack(np.array(tangent_angle), np.array(center))


def rotated_state(membranes: Membranes, state: Array, tilt: float) -> Array:
    """Rotate two vesicles, and move the middle of their centers to the origin.

    Parameters
    ----------
    membranes : Membranes
    state : (state_size,)
    tilt : float
        Angle of the line of centers against y afterwards, radians.

    Returns
    -------
    (state_size,)
    """
    tangent_angle, center = membranes.tangent_angle(state), membranes.center(state)
    first, second = membranes.curve_center(state)
    offset = second - first
    angle = np.pi / 2 + tilt - np.arctan2(offset[1], offset[0])
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return membranes.pack(tangent_angle + angle, (center - 0.5 * (first + second)) @ rotation.T)
