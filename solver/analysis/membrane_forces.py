"""The forces by which membranes act on the fluid in recorded states, by kind (Quaife et al. 2019, eq. 3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.forces.adhesion import DirectAdhesion
from solver.forces.bending import bending_of
from solver.membrane.geometry import Geometry, Membranes
from solver.motion.equation import accuracy_of
from solver.potentials.proximity import Closeness

if TYPE_CHECKING:
    from solver.analysis.run import Frames
    from solver.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MembraneForces:
    """Forces per length at the points of the membranes, each (frames, vesicles, points, 2).

    Attributes
    ----------
    bending : array
        −κ x_ssss.  On circles that have a viscosity contrast the constant tension that keeps them round is
        part of it.
    tension : array
        (σ x_s)_s.
    adhesion : array or None
        By all other vesicles; None without adhesion.
    """

    bending: Array
    tension: Array
    adhesion: Array | None


def membrane_forces(scene: Scene, frames: Frames) -> MembraneForces:
    """Compute the forces in recorded states.

    Parameters
    ----------
    scene : Scene
        Of the run.
    frames : Frames
        Its recorded states.  Where one is not finite, neither are its forces.

    Returns
    -------
    MembraneForces
    """
    membranes = Membranes.of(scene.vesicles, frames.tangent_angle.shape[-1])
    bending = bending_of(membranes)
    adhesion = None
    if scene.adhesion is not None and membranes.count > 1:
        adhesion = DirectAdhesion(scene.adhesion, accuracy_of(scene.numerics), membranes)
    shape = (*frames.tangent_angle.shape, 2)
    bent, tense = np.full((2, *shape), np.nan)
    adhered = np.full(shape, np.nan) if adhesion else None
    for index, tension in enumerate(frames.tension):
        state = membranes.pack(frames.tangent_angle[index], frames.center[index])
        if not np.isfinite(state).all():
            continue
        geometry = Geometry(membranes, state)
        bent[index] = np.moveaxis(bending.density(geometry), 0, -1)
        tense[index] = np.moveaxis(geometry.arclength_derivative(tension * geometry.tangents), 0, -1)
        if adhesion and adhered is not None:
            adhered[index] = np.moveaxis(adhesion.density(geometry, Closeness(geometry)), 0, -1)
    return MembraneForces(bent, tense, adhered)
