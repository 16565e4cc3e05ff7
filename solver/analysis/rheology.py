"""Intrinsic viscosity of a dilute suspension in a flow with the same gradient A everywhere.

With f the force of the membrane on the fluid, [μ] = −1/(rate·area) ∫ f · D x ds averaged over time, where
area is that of all vesicles, D = A/rate, and the shear rate is √(2 E:E) with the rate of strain E.  In shear
f · D x = f_x y (Quaife et al. 2019, section V; the sign follows from the direction of f).  The rotation in D
does no work, because membranes exert no torque: [μ] is the power per volume over that of the fluid alone.
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


def stress(geometry: Geometry, density: Array, gradient: Array) -> float:
    """Return the stress −∫ f · D x ds of a force density.

    Parameters
    ----------
    geometry : Geometry
    density : (2, M, N)
        Force per length.
    gradient : (2, 2)
        D, the velocity gradient over the shear rate.

    Returns
    -------
    float
        Over all membranes, images included.
    """
    # Products with 0 are no sums of their own: in shear these are f_x y to the last bit.
    velocity = (gradient @ geometry.points.reshape(2, -1)).reshape(geometry.points.shape)
    moment = np.sum(density[0] * velocity[0] + density[1] * velocity[1], axis=1)
    return float(-geometry.membranes.multiplicity * np.sum(moment * geometry.membranes.spacing))


def membrane_stress(motion: Motion, gradient: Array) -> float:
    """Return the part of the stress that bending and tension cause.

    Parameters
    ----------
    motion : Motion
    gradient : (2, 2)
        See `stress`.

    Returns
    -------
    float
    """
    geometry = motion.geometry
    tension_force = geometry.arclength_derivative(motion.tension * geometry.tangents)
    return stress(geometry, motion.bending + tension_force, gradient)


def adhesion_stress(motion: Motion, gradient: Array) -> float:
    """Return the part of the stress that adhesion causes.

    Parameters
    ----------
    motion : Motion
        Of a scene with adhesion.
    gradient : (2, 2)
        See `stress`.

    Returns
    -------
    float
    """
    assert motion.adhesion is not None
    return stress(motion.geometry, motion.adhesion, gradient)


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
