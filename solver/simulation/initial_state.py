"""The state in which a run begins."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.membrane.geometry import Membranes
from solver.membrane.resampling import resampled_angle
from solver.membrane.shapes import ellipse_tangent_angle, of_reduced_area
from solver.membrane.symmetry import independent_vesicles
from solver.scene.tangent_angles import closed_of_reduced_area

if TYPE_CHECKING:
    from solver.scene import Scene, Vesicle
    from solver.scene.start import RandomWaves

Array = NDArray[np.float64]


def placed_state(scene: Scene) -> Array:
    """Return the state of the vesicles in their shapes, where the scene places them.

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
        _shape(vesicle, index, scene.start.deformation, membranes.points)
        for index, vesicle in enumerate(vesicles)
    ]
    center = [vesicle.center for vesicle in vesicles]
    return membranes.pack(np.array(tangent_angle), np.array(center))


def _shape(vesicle: Vesicle, index: int, deformation: RandomWaves | None, points: int) -> Array:
    """Return the tangent angles of a vesicle, (points,)."""
    area = vesicle.reduced_area
    if vesicle.tangent_angle is None:
        shape = of_reduced_area(ellipse_tangent_angle(area, vesicle.length, vesicle.angle, points), area)
    else:
        given = resampled_angle(np.array(vesicle.tangent_angle), points)
        shape = closed_of_reduced_area(given + vesicle.angle, area)
    if deformation is None:
        return shape
    return closed_of_reduced_area(shape + deformation.change(index, points), area)


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
