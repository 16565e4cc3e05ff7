"""Intrinsic viscosity of a dilute suspension in shear.

With f the force of the membrane on the fluid, [μ] = −1/(rate·area) ∫ f_x y ds averaged over time, where area
is that of all vesicles (Quaife et al. 2019, section V; the sign follows from the direction of f).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis.run import Viscosity

if TYPE_CHECKING:
    from collections.abc import Mapping

    from solver.membrane.geometry import Geometry
    from solver.motion.equation import Motion

Array = NDArray[np.float64]


def shear_stress(geometry: Geometry, density: Array) -> float:
    """Return the shear stress −∫ f_x y ds of a force density.

    Parameters
    ----------
    geometry : Geometry
    density : (2, M, N)
        Force per length.

    Returns
    -------
    float
        Over all membranes, images included.
    """
    moment = np.sum(density[0] * geometry.points[1], axis=1)
    return float(-geometry.membranes.multiplicity * np.sum(moment * geometry.membranes.spacing))


def membrane_stress(motion: Motion) -> float:
    """Return the part of the shear stress that bending and tension cause.

    Parameters
    ----------
    motion : Motion

    Returns
    -------
    float
    """
    geometry = motion.geometry
    tension_force = geometry.arclength_derivative(motion.tension * geometry.tangents)
    return shear_stress(geometry, motion.bending + tension_force)


def adhesion_stress(motion: Motion) -> float:
    """Return the part of the shear stress that adhesion causes.

    Parameters
    ----------
    motion : Motion
        Of a scene with adhesion.

    Returns
    -------
    float
    """
    assert motion.adhesion is not None
    return shear_stress(motion.geometry, motion.adhesion)


def viscosity_of(parts: Mapping[str, float]) -> Viscosity:
    """Add up the parts of an intrinsic viscosity.

    Parameters
    ----------
    parts : mapping
        By the names of their series.

    Returns
    -------
    Viscosity
    """
    return Viscosity(
        total=sum(parts.values()),
        bending_tension=parts["viscosity_bending_tension"],
        adhesion=parts.get("viscosity_adhesion"),
        contrast=parts.get("viscosity_contrast"),
    )
