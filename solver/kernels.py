"""Pairwise sums over membrane points, compiled.

Every function here is a plain double loop whose inner loop LLVM turns into SIMD code.  That needs two
things: ``error_model="numpy"`` (no branch for a division by zero) and a logarithm without a call, computed
from the number's bits.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Without "ninf" and "nnan": a run that diverges must show it.
compiled = partial(
    njit, cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz", "arcp"}
)


@intrinsic
def _bits_of(typing_context: Any, value: Any) -> Any:
    """The 64 bits of a double, as an integer."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.IntType(64))

    return types.int64(types.float64), generate


@intrinsic
def _double_of(typing_context: Any, bits: Any) -> Any:
    """The double with these 64 bits."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.int64), generate


_LN2 = float(np.log(2.0))
_MANTISSA = (1 << 52) - 1
_SQRT_HALF_BITS = 0x3FE6A09E667F3BCD


@compiled(inline="always")
def logarithm(x: float) -> float:
    """Natural logarithm of a positive normal double, to 3e-16.

    x = 2^e·m with m in [√½, √2); log m = 2 artanh(z), z = (m−1)/(m+1), as an odd polynomial: |z| ≤ 0.1716,
    so the first term left out, 2 z²¹/21, is below 1e-17.
    """
    shifted = _bits_of(x) - _SQRT_HALF_BITS
    exponent = shifted >> 52
    mantissa = _double_of((shifted & _MANTISSA) + _SQRT_HALF_BITS)
    z = (mantissa - 1.0) / (mantissa + 1.0)
    w = z * z
    series = 1 / 19.0
    series = series * w + 1 / 17.0
    series = series * w + 1 / 15.0
    series = series * w + 1 / 13.0
    series = series * w + 1 / 11.0
    series = series * w + 1 / 9.0
    series = series * w + 1 / 7.0
    series = series * w + 1 / 5.0
    series = series * w + 1 / 3.0
    return exponent * _LN2 + (2.0 * z + 2.0 * z * w * series)


@compiled
def stokeslets(targets: Array, sources: Array, xx: Array, xy: Array, yy: Array) -> None:
    """Fill the components (m, n) of (−log r I + r⊗r/r²)/4π from ``sources`` (2, n) to ``targets`` (2, m).

    Where a target is its own source the entries are meaningless and the caller's to overwrite.
    """
    scale = 1.0 / (4.0 * np.pi)
    for i in range(targets.shape[1]):
        xi, yi = targets[0, i], targets[1, i]
        for j in range(sources.shape[1]):
            dx = xi - sources[0, j]
            dy = yi - sources[1, j]
            r2 = dx * dx + dy * dy
            inverse = scale / r2
            isotropic = -0.5 * scale * logarithm(r2)
            xx[i, j] = isotropic + dx * dx * inverse
            xy[i, j] = dx * dy * inverse
            yy[i, j] = isotropic + dy * dy * inverse


@compiled
def complete_self_part(
    correction: Array, diagonal: float, tangents: Array, first: int, xx: Array, xy: Array, yy: Array
) -> None:
    """Turn point Stokeslets of one closed curve on itself into its single-layer quadrature.

    Parameters
    ----------
    correction : (n, n)
        What Kress's rule adds off the diagonal (`close_evaluation.logarithm_correction`).
    diagonal : float
        The whole logarithmic part on the diagonal, over 4π.
    tangents : (2, n)
    first : int
        Where the curve's rows and columns begin in the components.
    """
    scale = 1.0 / (4.0 * np.pi)
    n = tangents.shape[1]
    for i in range(n):
        row = first + i
        for j in range(n):
            xx[row, first + j] += correction[i, j]
        for j in range(n):
            yy[row, first + j] += correction[i, j]
        tx, ty = tangents[0, i], tangents[1, i]
        xx[row, row] = diagonal + scale * tx * tx
        xy[row, row] = scale * tx * ty
        yy[row, row] = diagonal + scale * ty * ty


@compiled
def stokeslet_derivatives(points: Array, forces: Array, xx: Array, xy: Array, yx: Array, yy: Array) -> None:
    """Fill the derivatives of the velocity at the first m of ``points`` (2, n) by all of them, (m, n) each.

    The velocity is the sum of Stokeslets of strength ``forces`` (2, n) at the points; with r = x − y and
    g = F·r, moving r by δ changes one of them by
    [−F (r·δ) + r (F·δ) + g δ − 2 g r (r·δ)/r²]/(4π r²).  ``xy`` is that of x-velocity by y, and so on.
    """
    scale = 1.0 / (4.0 * np.pi)
    for i in range(xx.shape[0]):
        xi, yi = points[0, i], points[1, i]
        for j in range(points.shape[1]):
            dx = xi - points[0, j]
            dy = yi - points[1, j]
            fx, fy = forces[0, j], forces[1, j]
            r2 = dx * dx + dy * dy
            inverse = scale / (r2 if r2 > 0.0 else np.inf)
            along = dx * fx + dy * fy
            pull = 2.0 * along * inverse * inverse * (1.0 / scale)
            xx[i, j] = -along * inverse + pull * dx * dx
            xy[i, j] = (fx * dy - dx * fy) * inverse + pull * dx * dy
            yx[i, j] = (fy * dx - dy * fx) * inverse + pull * dx * dy
            yy[i, j] = -along * inverse + pull * dy * dy
        xx[i, i] = -(xx[i].sum() - xx[i, i])
        xy[i, i] = -(xy[i].sum() - xy[i, i])
        yx[i, i] = -(yx[i].sum() - yx[i, i])
        yy[i, i] = -(yy[i].sum() - yy[i, i])


@compiled
def distances(targets: Array, sources: Array, tangents: Array, spacing: float, out: Array) -> None:
    """Distance of every target (2, m) to the curve through ``sources`` (2, n), to order ``spacing``².

    The curve is replaced by its tangent segments of length ``spacing`` at the nearest point.
    """
    for i in range(targets.shape[1]):
        xi, yi = targets[0, i], targets[1, i]
        nearest = np.inf
        for j in range(sources.shape[1]):
            dx = xi - sources[0, j]
            dy = yi - sources[1, j]
            nearest = min(nearest, dx * dx + dy * dy)
        for j in range(sources.shape[1]):
            dx = xi - sources[0, j]
            dy = yi - sources[1, j]
            if dx * dx + dy * dy <= nearest:
                along = abs(dx * tangents[0, j] + dy * tangents[1, j])
                inside = min(along, 0.5 * spacing)
                out[i] = np.sqrt(max(nearest - along * along, 0.0) + (along - inside) ** 2)
                break


@compiled
def pair_distances(points: Array, tangents: Array, spacing: Array, out: Array) -> None:
    """`distances` for all ordered pairs: out[a, b, i] is that of point i of vesicle a to curve b.

    points, tangents : (2, C, N); spacing : (C,); out : (M, C, N), its diagonal left alone
    """
    for target in range(out.shape[0]):
        for source in range(out.shape[1]):
            if target != source:
                distances(
                    points[:, target],
                    points[:, source],
                    tangents[:, source],
                    spacing[source],
                    out[target, source],
                )
