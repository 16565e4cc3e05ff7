"""Intrinsic viscosity of a dilute suspension in shear.

With f the force of the membrane on the fluid, [μ] = −1/(rate·area) ∫ f_x y ds averaged over time; area is
that of all vesicles (paper, section V; the sign follows from f).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.membrane.geometry import Geometry
from solver.motion.dense import Motion

Array = NDArray[np.float64]


def shear_stress(geometry: Geometry, density: Array) -> float:
    """−∫ f_x y ds of a force density (2, M, N) over all membranes."""
    moment = np.sum(density[0] * geometry.points[1], axis=1)
    return float(-geometry.membranes.copies * np.sum(moment * geometry.membranes.spacing))


def membrane_stress(motion: Motion) -> float:
    """The part of the shear stress that bending and tension cause."""
    geometry = motion.geometry
    tension_force = geometry.arclength_derivative(motion.tension * geometry.tangents)
    return shear_stress(geometry, motion.bending + tension_force)


def adhesion_stress(motion: Motion) -> float:
    """The part of the shear stress that adhesion causes; for a scene with adhesion."""
    assert motion.adhesion is not None
    return shear_stress(motion.geometry, motion.adhesion)
