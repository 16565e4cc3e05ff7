"""Stokeslets summed as they are computed, for flows too large to store or needed once.

`stokeslets.stokeslets` fills matrices, which pays when they multiply many forces.  Here nothing is stored,
and all time goes into arithmetic: logarithm and reciprocal of r² share one division, and the loop uses the
widest vectors that the processor has.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled, widest_vectors
from solver.potentials.logarithm import LOGARITHM_UNIT, logarithm_and_reciprocal

if TYPE_CHECKING:
    from solver.potentials.vesicle_tree import NearVesicles

Array = NDArray[np.float64]

# Added to r², so that a pair of coincident points has finite terms; nothing for distances above 1e-62.
_COINCIDENT = 1e-140


@compiled
def velocity(targets: Array, sources: Array, point_forces: Array) -> Array:
    """Return the velocity Σⱼ (−log r I + r⊗r/r²) fⱼ/4π at targets xᵢ, with r = xᵢ − yⱼ.

    A source at the target itself contributes nothing.

    Parameters
    ----------
    targets : (2, m)
    sources, point_forces : (2, n)

    Returns
    -------
    (2, m)
    """
    widest_vectors()
    isotropic = -0.5 * LOGARITHM_UNIT / (4.0 * np.pi)
    radial = 1.0 / (4.0 * np.pi)
    source_x, source_y = sources[0], sources[1]
    force_x, force_y = point_forces[0], point_forces[1]
    result = np.empty_like(targets)
    for i in range(targets.shape[1]):
        xi, yi = targets[0, i], targets[1, i]
        # Four sums, so that no term is scaled on its own.
        isotropic_x = isotropic_y = radial_x = radial_y = 0.0
        for j in range(sources.shape[1]):
            dx = xi - source_x[j]
            dy = yi - source_y[j]
            fx, fy = force_x[j], force_y[j]
            r2 = dx * dx + (dy * dy + _COINCIDENT)
            logarithm, inverse = logarithm_and_reciprocal(r2)
            # Chosen last: that costs less than choosing another r² (a masked instruction).
            logarithm = logarithm if r2 > _COINCIDENT else 0.0
            along = (dx * fx + dy * fy) * inverse
            isotropic_x += logarithm * fx
            isotropic_y += logarithm * fy
            radial_x += along * dx
            radial_y += along * dy
        result[0, i] = isotropic * isotropic_x + radial * radial_x
        result[1, i] = isotropic * isotropic_y + radial * radial_y
    return result


@compiled
def add_near_velocities(
    points: Array, point_forces: Array, near: NearVesicles, first: int, out: Array
) -> None:
    """Add the velocity of some vesicles that the point forces on near ones cause.

    Parameters
    ----------
    points : (2, M, n)
    point_forces : (M, 2, n)
    near : NearVesicles
    first : int
        Number of the first of the m vesicles that are targets.
    out : (2, m, n)
        Added to.
    """
    n = points.shape[2]
    begin = 0
    while begin < near.targets.size:
        target, end = near.targets[begin], begin
        while end < near.targets.size and near.targets[end] == target:
            end += 1
        sources, forces = np.empty((2, end - begin, n)), np.empty((2, end - begin, n))
        for k in range(begin, end):
            source = near.sources[k]
            for component in range(2):
                for i in range(n):
                    sources[component, k - begin, i] = points[component, source, i]
                    forces[component, k - begin, i] = point_forces[source, component, i]
        part = velocity(
            np.ascontiguousarray(points[:, target]), sources.reshape(2, -1), forces.reshape(2, -1)
        )
        out[:, target - first] += part
        begin = end
