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

MAXIMUM_FACTOR = 32  # of refinement; beyond it a close point is not resolved

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
    regular_part: Array, diagonal: float, tangents: Array, first: int, xx: Array, xy: Array, yy: Array
) -> None:
    """Turn point Stokeslets of one closed curve on itself into its single-layer quadrature.

    Parameters
    ----------
    regular_part : (n, n)
        What Kress's split of the logarithm adds off the diagonal, over 4π (`stokes.SingleLayer`).
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
            xx[row, first + j] += regular_part[i, j]
        for j in range(n):
            yy[row, first + j] += regular_part[i, j]
        tx, ty = tangents[0, i], tangents[1, i]
        xx[row, row] = diagonal + scale * tx * tx
        xy[row, row] = scale * tx * ty
        yy[row, row] = diagonal + scale * ty * ty


@compiled
def stokeslet_derivatives(points: Array, forces: Array, xx: Array, xy: Array, yx: Array, yy: Array) -> None:
    """Fill the derivatives of the velocity at each of ``points`` (2, n) by all of them, (n, n) each.

    The velocity is the sum of Stokeslets of strength ``forces`` (2, n) at the points; with r = x − y and
    g = F·r, moving r by δ changes one of them by
    [−F (r·δ) + r (F·δ) + g δ − 2 g r (r·δ)/r²]/(4π r²).  ``xy`` is that of x-velocity by y, and so on.
    """
    scale = 1.0 / (4.0 * np.pi)
    for i in range(points.shape[1]):
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
def refinement_factors(distance_per_spacing: Array, ratio: float) -> Indices:
    """Least powers of two, at most 32, that times the distance/spacing (n,) of each point reach ``ratio``."""
    factors = np.ones(distance_per_spacing.size, dtype=np.int64)
    for i in range(factors.size):
        while factors[i] < MAXIMUM_FACTOR and factors[i] * distance_per_spacing[i] < ratio:
            factors[i] *= 2
    return factors


@compiled
def refine_single_layer(
    points: Array, distances: Array, ratio: float, interpolations: Array, xx: Array, xy: Array, yy: Array
) -> None:
    """Replace the rows of targets that are close to another vesicle.

    Its points are refined for them, and the refined columns are folded back onto its own points.

    Parameters
    ----------
    points : (2, M, n)
    distances : (M, M, n)
        Distance over spacing, by target, source and point of the target.
    ratio : float
        What is to be reached, by `refinement_factors`.
    interpolations : (rows, n)
        `spectral.interpolations` for all factors that occur.
    xx, xy, yy : (M·n, M·n), written
    """
    count, n = points.shape[1], points.shape[2]
    for target in range(count):
        for source in range(count):
            if target == source:
                continue
            factors = refinement_factors(distances[target, source], ratio)
            factor = 2
            while factor <= factors.max():
                rows = np.flatnonzero(factors == factor)
                if rows.size > 0:
                    interpolation = interpolations[(factor - 2) * n : (2 * factor - 2) * n]
                    fine = np.dot(np.ascontiguousarray(points[:, source]), interpolation.T)
                    shape = (rows.size, fine.shape[1])
                    fine_xx, fine_xy, fine_yy = np.empty(shape), np.empty(shape), np.empty(shape)
                    stokeslets(points[:, target][:, rows], fine, fine_xx, fine_xy, fine_yy)
                    folded_xx = np.dot(fine_xx, interpolation)
                    folded_xy = np.dot(fine_xy, interpolation)
                    folded_yy = np.dot(fine_yy, interpolation)
                    first, last = source * n, (source + 1) * n
                    for k in range(rows.size):
                        row = target * n + rows[k]
                        xx[row, first:last] = folded_xx[k] / factor
                        xy[row, first:last] = folded_xy[k] / factor
                        yy[row, first:last] = folded_yy[k] / factor
                factor *= 2


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
    """`distances` for all ordered pairs: out[a, b, i] is that of point i of vesicle a to vesicle b.

    points, tangents : (2, M, N); spacing : (M,); out : (M, M, N), its diagonal left alone
    """
    for target in range(points.shape[1]):
        for source in range(points.shape[1]):
            if target != source:
                distances(
                    points[:, target],
                    points[:, source],
                    tangents[:, source],
                    spacing[source],
                    out[target, source],
                )


@compiled(inline="always")
def _powers(
    dx: Array, dy: Array, square: float, m: int, n: int, inverse: Array, high: Array, low: Array
) -> None:
    """Write 1/r², (δ/r)^m and (δ/r)^n for offsets (dx, dy) of one row, δ² = ``square``.

    The exponents are known only at run time, so each multiplication is a loop of its own over the row.
    """
    for j in range(dx.size):
        inverse[j] = 1.0 / (dx[j] * dx[j] + dy[j] * dy[j])
        low[j] = 1.0
    for _ in range(n // 2):
        for j in range(dx.size):
            low[j] *= square * inverse[j]
    for j in range(dx.size):
        high[j] = low[j]
    for _ in range(m // 2 - n // 2):
        for j in range(dx.size):
            high[j] *= square * inverse[j]
    if n % 2 == 1:
        for j in range(dx.size):
            low[j] *= np.sqrt(square * inverse[j])
    if m % 2 == 1:
        for j in range(dx.size):
            high[j] *= np.sqrt(square * inverse[j])


@compiled
def adhesion_force(
    targets: Array, sources: Array, distance: float, m: int, n: int, scale: float, out: Array
) -> None:
    """Write scale·Σ (x−y)/r² [(δ/r)^m − (δ/r)^n] over ``sources`` (2, s) to out (2, t) for each target."""
    dx, dy, inverse, high, low = np.empty((5, sources.shape[1]))
    for i in range(targets.shape[1]):
        for j in range(sources.shape[1]):
            dx[j] = targets[0, i] - sources[0, j]
            dy[j] = targets[1, i] - sources[1, j]
        _powers(dx, dy, distance * distance, m, n, inverse, high, low)
        fx = 0.0
        fy = 0.0
        for j in range(sources.shape[1]):
            strength = inverse[j] * (high[j] - low[j])
            fx += dx[j] * strength
            fy += dy[j] * strength
        out[0, i] = scale * fx
        out[1, i] = scale * fy


@compiled
def adhesion_density(
    points: Array,
    spacing: Array,
    distances: Array,
    ratio: float,
    interpolations: Array,
    distance: float,
    m: int,
    n: int,
    strength: float,
    density: Array,
) -> None:
    """Add the adhesion force per length to ``density`` (2, M, N); arguments as in `refine_single_layer`."""
    count, size = points.shape[1], points.shape[2]
    for target in range(count):
        for source in range(count):
            if target == source:
                continue
            factors = refinement_factors(distances[target, source], ratio)
            factor = 1
            while factor <= factors.max():
                rows = np.flatnonzero(factors == factor)
                if rows.size > 0:
                    fine = np.ascontiguousarray(points[:, source])
                    if factor > 1:
                        interpolation = interpolations[(factor - 2) * size : (2 * factor - 2) * size]
                        fine = np.dot(fine, interpolation.T)
                    force = np.empty((2, rows.size))
                    scale = strength * spacing[source] / factor
                    adhesion_force(points[:, target][:, rows], fine, distance, m, n, scale, force)
                    for k in range(rows.size):
                        density[0, target, rows[k]] += force[0, k]
                        density[1, target, rows[k]] += force[1, k]
                factor *= 2


@compiled
def adhesion_energy(targets: Array, sources: Array, distance: float, m: int, n: int) -> float:
    """Σ Σ (δ/r)^m − (m/n)(δ/r)^n over ``targets`` (2, t) and ``sources`` (2, s)."""
    dx, dy, inverse, high, low = np.empty((5, sources.shape[1]))
    ratio = m / n
    total = 0.0
    for i in range(targets.shape[1]):
        for j in range(sources.shape[1]):
            dx[j] = targets[0, i] - sources[0, j]
            dy[j] = targets[1, i] - sources[1, j]
        _powers(dx, dy, distance * distance, m, n, inverse, high, low)
        for j in range(sources.shape[1]):
            total += high[j] - ratio * low[j]
    return total


@compiled
def adhesion_hessian(
    targets: Array,
    sources: Array,
    distance: float,
    m: int,
    n: int,
    scale: float,
    xx: Array,
    xy: Array,
    yy: Array,
) -> None:
    """Fill the components (t, s) of the derivative of each pair's force by the target's position."""
    dx, dy, inverse, high, low = np.empty((5, sources.shape[1]))
    for i in range(targets.shape[1]):
        for j in range(sources.shape[1]):
            dx[j] = targets[0, i] - sources[0, j]
            dy[j] = targets[1, i] - sources[1, j]
        _powers(dx, dy, distance * distance, m, n, inverse, high, low)
        for j in range(sources.shape[1]):
            strength = scale * inverse[j] * (high[j] - low[j])
            radial = -scale * inverse[j] * inverse[j] * ((m + 2) * high[j] - (n + 2) * low[j])
            xx[i, j] = strength + radial * dx[j] * dx[j]
            xy[i, j] = radial * dx[j] * dy[j]
            yy[i, j] = strength + radial * dy[j] * dy[j]


@compiled
def adhesion_hessians(
    points: Array,
    spacing: Array,
    distances: Array,
    ratio: float,
    interpolations: Array,
    distance: float,
    m: int,
    n: int,
    strength: float,
    hessian: Array,
) -> None:
    """Fill the components (3, M·N, M·N) of the derivative of `adhesion_density` by the points."""
    count, size = points.shape[1], points.shape[2]
    hessian[:] = 0.0
    for target in range(count):
        for source in range(count):
            if target == source:
                continue
            factors = refinement_factors(distances[target, source], ratio)
            factor = 1
            while factor <= factors.max():
                rows = np.flatnonzero(factors == factor)
                if rows.size > 0:
                    sources = np.ascontiguousarray(points[:, source])
                    interpolation = interpolations[(factor - 2) * size : (2 * factor - 2) * size]
                    fine = np.dot(sources, interpolation.T) if factor > 1 else sources
                    pair = np.empty((3, rows.size, fine.shape[1]))
                    scale = strength * spacing[source] / factor
                    adhesion_hessian(
                        points[:, target][:, rows], fine, distance, m, n, scale, pair[0], pair[1], pair[2]
                    )
                    first, last = source * size, (source + 1) * size
                    for component in range(3):
                        folded = np.dot(pair[component], interpolation) if factor > 1 else pair[component]
                        for k in range(rows.size):
                            row = target * size + rows[k]
                            hessian[component, row, first:last] = -folded[k]
                            hessian[component, row, row] += pair[component, k].sum()
                factor *= 2
