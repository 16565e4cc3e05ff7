"""The state in which a run begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.geometry import Membranes
from solver.scene import Scene
from solver.shapes import ellipse_tangent_angle

Array = NDArray[np.float64]


def placed_state(scene: Scene) -> Array:
    """Ellipses where the scene places them."""
    points = scene.numerics.points
    tangent_angle = [
        ellipse_tangent_angle(vesicle.reduced_area, vesicle.length, vesicle.angle, points)
        for vesicle in scene.vesicles
    ]
    center = [vesicle.center for vesicle in scene.vesicles]
    return Membranes.of(scene.vesicles, points).pack(np.array(tangent_angle), np.array(center))


def turned_state(membranes: Membranes, state: Array, tilt: float) -> Array:
    """Two vesicles about the origin with their line of centers along y, plus ``tilt`` radians."""
    tangent_angle, center = membranes.tangent_angle(state), membranes.center(state)
    offset = center[1] - center[0]
    turn = np.pi / 2 + tilt - np.arctan2(offset[1], offset[0])
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return membranes.pack(tangent_angle + turn, (center - center.mean(axis=0)) @ rotation.T)
