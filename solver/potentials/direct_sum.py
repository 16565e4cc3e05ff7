"""Stokeslets summed as they are computed, for flows too large to store or needed once.

`stokeslets.stokeslets` fills matrices, which pays when they multiply many forces.  Here nothing is stored,
and all time goes into arithmetic: logarithm and reciprocal of r² share one division, and the loop uses the
widest vectors that the processor has.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled, widest_vectors
from solver.potentials.logarithm import LOGARITHM_UNIT, logarithm_and_reciprocal

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
