"""Sums over pairs of membrane points, compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled, widest_vectors
from solver.potentials.logarithm import LOGARITHM_UNIT, logarithm_and_reciprocal

Array = NDArray[np.float64]


@compiled
def stokeslets(targets: Array, sources: Array, components: Array) -> None:
    """Fill the components xx, xy, yy of (−log r I + r⊗r/r²)/4π between points.

    Where a target is its own source the entries are meaningless; the caller overwrites them.

    Parameters
    ----------
    targets : (2, m)
    sources : (2, n)
    components : (3, m, n)
        Written to.
    """
    widest_vectors()
    radial = 1.0 / (4.0 * np.pi)
    isotropic = -0.5 * LOGARITHM_UNIT * radial
    source_x, source_y = sources[0], sources[1]
    for i in range(targets.shape[1]):
        xi, yi = targets[0, i], targets[1, i]
        # As rows: indexed in three dimensions the loop is not turned into SIMD code.
        xx, xy, yy = components[0, i], components[1, i], components[2, i]
        for j in range(source_x.size):
            dx = xi - source_x[j]
            dy = yi - source_y[j]
            logarithm, reciprocal = logarithm_and_reciprocal(dx * dx + dy * dy)
            inverse = radial * reciprocal
            diagonal = isotropic * logarithm
            xx[j] = diagonal + dx * dx * inverse
            xy[j] = dx * dy * inverse
            yy[j] = diagonal + dy * dy * inverse


@compiled
def complete_self_parts(
    correction: Array, diagonal: Array, tangents: Array, components: Array, begin: int
) -> None:
    """Turn point Stokeslets of closed curves on themselves into their single-layer quadrature.

    Parameters
    ----------
    correction : (n, n)
        What the rule of Kress (2014) adds off the diagonal (`close_evaluation.logarithm_correction`).
    diagonal : (M,)
        The whole logarithmic part on the diagonal, over 4π.
    tangents : (2, M, n)
    components : (3, m, ·)
        Of `stokeslets` at m points; the sources begin with all M·n points.  Changed in place.
    begin : int
        Number of the first of the m points.
    """
    scale = 1.0 / (4.0 * np.pi)
    n = tangents.shape[2]
    for row in range(components.shape[1]):
        point = begin + row
        vesicle, i = point // n, point % n
        first = vesicle * n
        # As rows: indexed in three dimensions the loop is not turned into SIMD code.
        xx, yy, missing = (
            components[0, row, first : first + n],
            components[2, row, first : first + n],
            correction[i],
        )
        for j in range(n):
            xx[j] += missing[j]
            yy[j] += missing[j]
        tx, ty = tangents[0, vesicle, i], tangents[1, vesicle, i]
        components[0, row, point] = diagonal[vesicle] + scale * tx * tx
        components[1, row, point] = scale * tx * ty
        components[2, row, point] = diagonal[vesicle] + scale * ty * ty


@compiled
def join_components(components: Array, matrix: Array) -> None:
    """Write components into one matrix.

    Columns beyond m belong to images, on which forces are opposite.

    Parameters
    ----------
    components : (3, m, n)
        As of `stokeslets`.
    matrix : (2m, 2m)
        Written to.
    """
    m = components.shape[1]
    for block in range(4):
        row, column, component = block // 2 * m, block % 2 * m, (block + 1) // 2  # xx, xy, xy and yy
        for i in range(m):
            joined, own = matrix[row + i, column : column + m], components[component, i, :m]
            if components.shape[2] == m:
                for j in range(m):
                    joined[j] = own[j]
            else:
                image = components[component, i, m:]
                for j in range(m):
                    joined[j] = own[j] - image[j]


@compiled
def stokeslet_derivatives(points: Array, forces: Array, by_points: Array, first: int) -> None:
    """Fill the derivatives of the velocity at some points by the positions of the vesicles' points.

    The velocity is the sum of Stokeslets at the points.  With r = x − y, the strength F and g = F·r, moving
    r by δ changes one of them by [−F (r·δ) + r (F·δ) + g δ − 2 g r (r·δ)/r²]/(4π r²).

    Parameters
    ----------
    points : (2, n) or (2, 2n)
        Of the vesicles, and then of their images if there are any, which move the opposite way.
    forces : as points
        Strengths.
    by_points : (2, m, 2, n)
        Written to.
    first : int
        Number of the first of the m points.
    """
    widest_vectors()
    scale = 1.0 / (4.0 * np.pi)
    n = by_points.shape[3]
    by_points[:] = 0.0
    for i in range(by_points.shape[1]):
        xi, yi = points[0, first + i], points[1, first + i]
        # As rows: indexed in four dimensions the loop is not turned into SIMD code.
        xx, xy, yx, yy = by_points[0, i, 0], by_points[0, i, 1], by_points[1, i, 0], by_points[1, i, 1]
        sum_xx = sum_xy = sum_yx = sum_yy = 0.0
        for begin in range(0, points.shape[1], n):
            sign = 1.0 if begin == 0 else -1.0
            source_x, source_y = points[0, begin : begin + n], points[1, begin : begin + n]
            force_x, force_y = forces[0, begin : begin + n], forces[1, begin : begin + n]
            for j in range(n):
                dx = xi - source_x[j]
                dy = yi - source_y[j]
                fx, fy = force_x[j], force_y[j]
                r2 = dx * dx + dy * dy
                inverse = scale / r2 if r2 > 0.0 else 0.0
                along = (dx * fx + dy * fy) * inverse
                across = (fx * dy - dx * fy) * inverse
                pull = 2.0 * along * inverse * (1.0 / scale)
                of_xx, of_yy = pull * dx * dx - along, pull * dy * dy - along
                of_xy, of_yx = pull * dx * dy + across, pull * dx * dy - across
                xx[j] += sign * of_xx
                xy[j] += sign * of_xy
                yx[j] += sign * of_yx
                yy[j] += sign * of_yy
                sum_xx += of_xx
                sum_xy += of_xy
                sum_yx += of_yx
                sum_yy += of_yy
        xx[first + i] -= sum_xx
        xy[first + i] -= sum_xy
        yx[first + i] -= sum_yx
        yy[first + i] -= sum_yy


@compiled
def add_tangent_rotation(tangents: Array, forces: Array, by_state: Array) -> None:
    """Add what rotating tangents change where a point is its own source: there r⊗r/r² is t⊗t.

    Parameters
    ----------
    tangents, forces : (2, M, n)
        At the points; the forces are point forces.
    by_state : (2, M·n, state_size)
        Derivatives of velocities by the tangent angles, which come first.  Changed in place.
    """
    scale = 1.0 / (4.0 * np.pi)
    _, count, n = tangents.shape
    for vesicle in range(count):
        for j in range(n):
            tx, ty = tangents[0, vesicle, j], tangents[1, vesicle, j]
            along = scale * (tx * forces[0, vesicle, j] + ty * forces[1, vesicle, j])
            across = scale * (tx * forces[1, vesicle, j] - ty * forces[0, vesicle, j])
            point = vesicle * n + j
            by_state[0, point, point] += tx * across - ty * along
            by_state[1, point, point] += tx * along + ty * across


@compiled
def distances(
    target_x: Array,
    target_y: Array,
    x: Array,
    y: Array,
    tangent_x: Array,
    tangent_y: Array,
    spacing: float,
    out: Array,
) -> None:
    """Write the distance of every target to a curve, to the second order in its spacing.

    The curve is replaced by the tangent segment, of length ``spacing``, at its nearest point.

    Parameters
    ----------
    target_x, target_y : (m,)
    x, y, tangent_x, tangent_y : (n,)
        Of the curve.
    spacing : float
        Arclength between neighboring points of the curve.
    out : (m,)
        Written to.
    """
    widest_vectors()
    squares, nearest = np.empty(out.size), np.empty(out.size, dtype=np.int64)
    for i in range(out.size):
        squares[i], nearest[i] = np.inf, 0
    for j in range(x.size):
        xj, yj = x[j], y[j]
        for i in range(out.size):  # the inner loop, or there is no SIMD code
            dx, dy = target_x[i] - xj, target_y[i] - yj
            square, least = dx * dx + dy * dy, squares[i]
            squares[i] = square if square < least else least
            nearest[i] = j if square < least else nearest[i]
    for i in range(out.size):
        at = nearest[i]
        dx, dy = target_x[i] - x[at], target_y[i] - y[at]
        along = abs(dx * tangent_x[at] + dy * tangent_y[at])
        inside = min(along, 0.5 * spacing)
        out[i] = np.sqrt(max(squares[i] - along * along, 0.0) + (along - inside) ** 2)


@compiled
def waists(points: Array) -> Array:
    """Return how near each curve comes to itself: between points at least an eighth of its length apart.

    Parameters
    ----------
    points : (2, M, n)

    Returns
    -------
    (M,)
    """
    count, n = points.shape[1], points.shape[2]
    out = np.empty(count)
    apart = n // 8
    for vesicle in range(count):
        nearest = np.inf
        for i in range(n):
            for j in range(i + apart, min(n, i + n - apart + 1)):
                dx = points[0, vesicle, i] - points[0, vesicle, j]
                dy = points[1, vesicle, i] - points[1, vesicle, j]
                nearest = min(nearest, dx * dx + dy * dy)
        out[vesicle] = np.sqrt(nearest)
    return out


@compiled
def pair_distances(points: Array, tangents: Array, spacing: Array, out: Array) -> float:
    """Write the `distances` between curves over the spacing of the source, for all ordered pairs.

    Parameters
    ----------
    points, tangents : (2, C, N)
    spacing : (C,)
    out : (count, C, N), written to
        [a, b, i] is for point i of curve a, one of the first, and curve b; infinite from a curve to itself.

    Returns
    -------
    float
        The smallest.
    """
    smallest = np.inf
    for target in range(out.shape[0]):
        for source in range(out.shape[1]):
            own = out[target, source]
            if target == source:
                own[:] = np.inf
                continue
            distances(
                points[0, target],
                points[1, target],
                points[0, source],
                points[1, source],
                tangents[0, source],
                tangents[1, source],
                spacing[source],
                own,
            )
            for i in range(own.size):
                own[i] /= spacing[source]
                smallest = min(smallest, own[i])
    return smallest
