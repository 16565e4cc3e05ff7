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
from solver.compilation import compiled

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
    membranes = geometry.membranes
    return -membranes.multiplicity * float(_power(density, geometry.points, gradient, membranes.spacing))


@compiled
def _power(density: Array, points: Array, gradient: Array, spacing: Array) -> float:
    """Compute ∫ f · D x ds over the vesicles."""
    total = 0.0
    for vesicle in range(spacing.size):
        fx, fy, x, y = density[0, vesicle], density[1, vesicle], points[0, vesicle], points[1, vesicle]
        own = 0.0
        for j in range(x.size):
            own += fx[j] * (gradient[0, 0] * x[j] + gradient[0, 1] * y[j])
            own += fy[j] * (gradient[1, 0] * x[j] + gradient[1, 1] * y[j])
        total += own * spacing[vesicle]
    return total


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
