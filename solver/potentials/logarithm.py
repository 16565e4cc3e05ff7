"""A logarithm without a call, from the number's bits, so that a loop around it becomes SIMD code."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

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
def _bits_of(typing_context: Any, value: Any) -> Any:
    """Return the 64 bits of a double as an integer."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.IntType(64))

    return types.int64(types.float64), generate


@intrinsic
def _double_of(typing_context: Any, bits: Any) -> Any:
    """Return the double with these 64 bits."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.int64), generate


# Not reassociated: x·m ± x keeps its rounding.  Not cached either: it is part of functions that are.
@njit(nogil=True, error_model="numpy", fastmath={"contract"})
def logarithm_and_reciprocal(x: float) -> tuple[float, float]:
    """Return log(x)/`LOGARITHM_UNIT` and 1/x, by one division, to 3e-16.

    x = 2^e·m with m in [√½, √2), and log m = 2 artanh(z) with z = (m−1)/(m+1).  With v = 1/(x(m+1)) that is
    z = x(m−1)v, and 1/x = v(m+1).

    Parameters
    ----------
    x : float
        Positive, normal, below 1e307.

    Returns
    -------
    logarithm : float
    reciprocal : float
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


@njit(inline="always")
def logarithm(x: float) -> float:
    """Return the natural logarithm, to 3e-16.

    Parameters
    ----------
    x : float
        Positive, normal, below 1e307.

    Returns
    -------
    float
    """
    return LOGARITHM_UNIT * logarithm_and_reciprocal(x)[0]
