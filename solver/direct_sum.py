"""Stokeslets summed as they are computed, for flows too large to store or needed once.

`kernels.stokeslets` fills matrices, which pays when they multiply many forces.  Here nothing is stored, so
that time goes into arithmetic alone: logarithm and reciprocal of r² share one division, and the loop uses
the widest vectors that the processor has.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from solver.kernels import _bits_of, _double_of, compiled

Array = NDArray[np.float64]

# Added to r², so that a pair of coincident points has finite terms; nothing for distances above 1e-62.
_COINCIDENT = 1e-140

_SQRT_HALF_BITS = 0x3FE6A09E667F3BCD
_EXPONENT = ~((1 << 52) - 1)

# The integer that holds the exponent's bits, e·2⁵², taken as a number is log₂ in this unit.
LOGARITHM_UNIT = float(np.log(2.0)) * 2.0**-52

# 2 artanh(z) = 2z + z(a₁ z² + a₂ z⁴ + … + a₆ z¹²), minimax on |z| ≤ 0.1716, to 4e-17; aₖ is nearly 2/(2k+1).
_A1, _A2, _A3, _A4, _A5, _A6 = (
    2.0 * coefficient / LOGARITHM_UNIT
    for coefficient in (
        0.3333333333325694,
        0.20000000040522278,
        0.14285706597323922,
        0.11111807905844258,
        0.09058301505083773,
        0.08448263973221139,
    )
)
_A0 = 2.0 / LOGARITHM_UNIT


@intrinsic
def _widest_vectors(typing_context: Any) -> Any:
    """Let LLVM use 512-bit vectors in the function that calls this, where the processor has them.

    By default it keeps to 256 bits on most of them, to spare the clock; sums gain a quarter without.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        # Past the attributes' own `add`, which knows no attributes with values.
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.void(), generate


# Not reassociated: x·m ± x keeps its rounding.
@partial(njit, cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def logarithm_and_reciprocal(x: float) -> tuple[float, float]:
    """log(x)/`LOGARITHM_UNIT` and 1/x of a positive normal double below 1e307, by one division, to 3e-16.

    x = 2^e·m with m in [√½, √2); log m = 2 artanh(z), z = (m−1)/(m+1).  With v = 1/(x(m+1)) that is
    z = x(m−1)v, and 1/x = v(m+1).
    """
    bits = _bits_of(x)
    exponent = (bits - _SQRT_HALF_BITS) & _EXPONENT
    mantissa = _double_of(bits - exponent)
    common = 1.0 / (x * mantissa + x)
    z = (x * mantissa - x) * common
    w = z * z
    series = _A6
    series = series * w + _A5
    series = series * w + _A4
    series = series * w + _A3
    series = series * w + _A2
    series = series * w + _A1
    series = series * w + _A0
    return exponent + z * series, common * mantissa + common


@compiled
def velocity(targets: Array, sources: Array, point_forces: Array) -> Array:
    """Σⱼ (−log r I + r⊗r/r²) fⱼ/4π with r = xᵢ − yⱼ, (2, m), for targets xᵢ (2, m) and sources yⱼ (2, n).

    A source at the target itself contributes nothing.
    """
    _widest_vectors()
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
