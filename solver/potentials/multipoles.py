"""Series for the velocity of point forces: about groups of vesicles, and about a vesicle that they act on.

In complex numbers, with z from the center of a circle to the target and t to a source in the circle, the
velocity of point forces f is that of two analytic functions (Greengard, Kropinski & Mayo 1996),

    8π u = −Φ + z Φ̄' − Ψ̄ + Σ f,   Φ = Σ f log(z − t),   Ψ = Σ [f̄ log(z − t) + t̄ f/(z − t)],

in which only the real part of logarithms counts, as their imaginary parts cancel.  With the circle's radius R
and the moments aₖ = Σ f (t/R)ᵏ and bₖ = Σ [f̄ (t/R)ᵏ − k t̄/R f (t/R)ᵏ⁻¹] they are outside of the circle

    Φ = a₀ log z − Σ aₖ/k (R/z)ᵏ,   Ψ = b₀ log z − Σ bₖ/k (R/z)ᵏ.

About another center, with z = δ + z', t̄ in Ψ is t̄ − δ̄: bₖ becomes bₖ + k δ̄/R aₖ₋₁.  Then both functions are
expanded about that center, in a circle of radius r outside of the first one (Greengard & Rokhlin 1987):

    Φ(δ + z') = a₀ log δ − Σⱼ (−z'/δ)ʲ Σₖ (k + j − 1)!/(j! k!) (R/δ)ᵏ aₖ.

These factors of (R/δ)ᵏ aₖ are a real matrix, the same for all pairs of circles, so that many pairs are one
product of matrices.
"""

from __future__ import annotations

from math import factorial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled, widest_vectors

if TYPE_CHECKING:
    from solver.potentials.vesicle_tree import FarNodes, VesicleTree

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Highest power that is used; measured: with more, series cost as much as the sums over points that they save.
LARGEST_ORDER = 32
LARGEST_OF_GROUP = 24  # the same about a group

_LANES = 16  # pairs of circles in one product of matrices; measured

# (k + j − 1)!/(j! k!), by j and k; bₖ has one power more than aₖ when it refers to another center.
_TRANSLATION = np.array(
    [
        [
            factorial(k + j - 1) / (factorial(j) * factorial(k)) if k + j else 0.0
            for k in range(LARGEST_ORDER + 2)
        ]
        for j in range(LARGEST_ORDER + 1)
    ]
)
_FACTORIALS = np.array([float(factorial(k)) for k in range(LARGEST_ORDER + 1)])
_INVERSE_FACTORIALS = 1.0 / _FACTORIALS


@compiled
def write_moments(
    points: Array, centers: Array, radii: Array, first: int, point_forces: Array, out: Array
) -> None:
    """Write the moments of some vesicles.

    Parameters
    ----------
    points : (2, M, n)
    centers : (2, M)
    radii : (M,)
    first : int
        Number of the first of the m vesicles.
    point_forces : (2, m, n)
        On these.
    out : (m, 4, p + 1)
        Written to, up to the power p: real and imaginary parts of aₖ, and those of bₖ.
    """
    widest_vectors()
    n, last = points.shape[2], out.shape[2] - 1
    tx, ty, product_x, product_y, power_x, power_y = np.empty((6, n))
    for row in range(out.shape[0]):
        vesicle = first + row
        scale = 1.0 / radii[vesicle]
        force_x, force_y = point_forces[0, row], point_forces[1, row]
        moments = out[row]
        for i in range(n):
            tx[i] = scale * (points[0, vesicle, i] - centers[0, vesicle])
            ty[i] = scale * (points[1, vesicle, i] - centers[1, vesicle])
            product_x[i] = tx[i] * force_x[i] + ty[i] * force_y[i]  # t̄ f
            product_y[i] = tx[i] * force_y[i] - ty[i] * force_x[i]
            power_x[i] = 1.0
            power_y[i] = 0.0
        before_x = before_y = 0.0
        for k in range(last + 1):
            xx = xy = yx = yy = 0.0
            product_along = product_across = 0.0
            for i in range(n):
                xx += force_x[i] * power_x[i]
                yy += force_y[i] * power_y[i]
                xy += force_x[i] * power_y[i]
                yx += force_y[i] * power_x[i]
                product_along += product_x[i] * power_x[i] - product_y[i] * power_y[i]
                product_across += product_x[i] * power_y[i] + product_y[i] * power_x[i]
                next_x = power_x[i] * tx[i] - power_y[i] * ty[i]
                power_y[i] = power_x[i] * ty[i] + power_y[i] * tx[i]
                power_x[i] = next_x
            moments[0, k], moments[1, k] = xx - yy, xy + yx
            moments[2, k], moments[3, k] = xx + yy - k * before_x, xy - yx - k * before_y
            before_x, before_y = product_along, product_across


@compiled
def group_moments(tree: VesicleTree, moments: Array, order: int) -> Array:
    """Compute the moments of groups from those of the vesicles.

    Parameters
    ----------
    tree : VesicleTree
        Of M vesicles.
    moments : (M, 4, ·)
        As of `write_moments`.
    order : int
        Highest power that is computed.

    Returns
    -------
    (M − 1, 4, order + 1)
    """
    count = moments.shape[0]
    groups = np.zeros((tree.children.shape[0], 4, order + 1))
    own, shift = np.empty((4, order + 1)), np.empty((2, order + 1))
    for group in range(groups.shape[0] - 1, -1, -1):
        for child in tree.children[group]:
            of_child = moments[child] if child < count else groups[child - count]
            _refer_to_group(tree, child, count + group, of_child, own, shift)
            _add_translated(own, shift, groups[group])
        for part in range(4):
            for k in range(order + 1):
                groups[group, part, k] *= _FACTORIALS[k]
    return groups


@compiled
def _refer_to_group(
    tree: VesicleTree, child: int, group: int, moments: Array, own: Array, shift: Array
) -> None:
    """Write moments on the group's scale and powers of the child's place in it, over factorials.

    The powers are in descending order, so that `_add_translated` runs upwards through both.
    """
    inverse = 1.0 / tree.radii[group]
    ratio = tree.radii[child] * inverse
    x = (tree.centers[0, child] - tree.centers[0, group]) * inverse
    y = (tree.centers[1, child] - tree.centers[1, group]) * inverse
    power_x, power_y, scale = 1.0, 0.0, 1.0
    before_x = before_y = 0.0
    last = own.shape[1] - 1
    for k in range(last + 1):
        over = _INVERSE_FACTORIALS[k]
        shift[0, last - k], shift[1, last - k] = over * power_x, over * power_y
        power_x, power_y = power_x * x - power_y * y, power_x * y + power_y * x
        ax, ay = scale * moments[0, k], scale * moments[1, k]
        own[0, k], own[1, k] = over * ax, over * ay
        # The group's center less the child's is −(x + iy).
        own[2, k] = over * (scale * moments[2, k] - k * (x * before_x + y * before_y))
        own[3, k] = over * (scale * moments[3, k] - k * (x * before_y - y * before_x))
        before_x, before_y = ax, ay
        scale *= ratio


@compiled
def _add_translated(own: Array, shift: Array, out: Array) -> None:
    """Add Σ aⱼ/j! (δ/R)ᵏ⁻ʲ/(k − j)!, the moments about the group over k!."""
    widest_vectors()
    last = own.shape[1] - 1
    for k in range(last + 1):
        shift_x, shift_y = shift[0, last - k :], shift[1, last - k :]
        ax = ay = bx = by = 0.0
        for j in range(k + 1):
            ax += shift_x[j] * own[0, j] - shift_y[j] * own[1, j]
            ay += shift_x[j] * own[1, j] + shift_y[j] * own[0, j]
            bx += shift_x[j] * own[2, j] - shift_y[j] * own[3, j]
            by += shift_x[j] * own[3, j] + shift_y[j] * own[2, j]
        out[0, k] += ax
        out[1, k] += ay
        out[2, k] += bx
        out[3, k] += by


@compiled
def add_series(
    tree: VesicleTree,
    far: FarNodes,
    first: int,
    moments: Array,
    of_groups: Array,
    out: Array,
    orders: Indices,
) -> None:
    """Add what nodes cause near vesicles: the series about these.

    With G and H for −Φ + Σ f and −Ψ these are the coefficients of G and H in powers of z'/r.

    Parameters
    ----------
    tree : VesicleTree
        Of M vesicles.
    far : FarNodes
        In any order; it costs least where neighbors have similar powers.
    first : int
        Number of the first of the m vesicles that are targets.
    moments : (M, 4, ·)
        As of `write_moments`.
    of_groups : (M − 1, 4, ·)
        As of `group_moments`.
    out : (m, 4, p + 1)
        Real and imaginary parts of both series, added to.
    orders : (m,)
        Raised to the highest power of each.
    """
    widest_vectors()
    source, work = np.empty((LARGEST_ORDER + 2, 4, _LANES)), np.empty((10, _LANES))
    for begin in range(0, far.nodes.size, _LANES):
        end = min(begin + _LANES, far.nodes.size)
        highest, powers = far.source_orders[begin:end].max() + 1, far.target_orders[begin:end].max()
        source[: highest + 1] = 0.0
        work[:] = 0.0
        for pair in range(begin, end):
            _take_moments(tree, far, pair, pair - begin, moments, of_groups, source, work)
        _scale_sources(source[: highest + 1], work)
        table = np.ascontiguousarray(_TRANSLATION[: powers + 1, : highest + 1])
        summed = np.dot(table, source[: highest + 1].reshape(highest + 1, 4 * _LANES))
        series = summed.reshape(powers + 1, 4, _LANES)
        _scale_series(series, source[0], work)
        for pair in range(begin, end):
            row, lane = out[far.targets[pair] - first], pair - begin
            orders[far.targets[pair] - first] = max(
                orders[far.targets[pair] - first], far.target_orders[pair]
            )
            for k in range(far.target_orders[pair] + 1):
                for part in range(4):
                    row[part, k] += series[k, part, lane]


@compiled
def _take_moments(
    tree: VesicleTree,
    far: FarNodes,
    pair: int,
    lane: int,
    moments: Array,
    of_groups: Array,
    source: Array,
    work: Array,
) -> None:
    """Copy the moments of a pair's node into a lane, and write R/δ, δ̄/δ, −r/δ and log |δ| of it."""
    target, node, order = far.targets[pair], far.nodes[pair], far.source_orders[pair]
    count = moments.shape[0]
    of_node = moments[node] if node < count else of_groups[node - count]
    for k in range(order + 1):
        for part in range(4):
            source[k, part, lane] = of_node[part, k]
    dx = tree.centers[0, target] - tree.centers[0, node]
    dy = tree.centers[1, target] - tree.centers[1, node]
    square = dx * dx + dy * dy
    inverse_x, inverse_y = dx / square, -dy / square
    work[0, lane], work[1, lane] = tree.radii[node] * inverse_x, tree.radii[node] * inverse_y
    work[2, lane] = (dx * dx - dy * dy) / square
    work[3, lane] = -2.0 * dx * dy / square
    work[4, lane], work[5, lane] = -tree.radii[target] * inverse_x, -tree.radii[target] * inverse_y
    work[6, lane] = 0.5 * np.log(square)


@compiled
def _scale_sources(source: Array, work: Array) -> None:
    """Multiply moments by the powers of R/δ, and refer Ψ to the target's center."""
    ratio_x, ratio_y, turn_x, turn_y = work[0], work[1], work[2], work[3]
    power_x, power_y = work[7], work[8]
    power_x[:] = 1.0
    power_y[:] = 0.0
    for k in range(1, source.shape[0]):
        before_x, before_y = source[k - 1, 0], source[k - 1, 1]
        ax, ay, bx, by = source[k, 0], source[k, 1], source[k, 2], source[k, 3]
        for lane in range(_LANES):
            x = power_x[lane] * ratio_x[lane] - power_y[lane] * ratio_y[lane]
            y = power_x[lane] * ratio_y[lane] + power_y[lane] * ratio_x[lane]
            power_x[lane], power_y[lane] = x, y
            along = turn_x[lane] * before_x[lane] - turn_y[lane] * before_y[lane]
            across = turn_x[lane] * before_y[lane] + turn_y[lane] * before_x[lane]
            scaled_x, scaled_y = x * ax[lane] - y * ay[lane], x * ay[lane] + y * ax[lane]
            ax[lane], ay[lane] = scaled_x, scaled_y
            scaled_x, scaled_y = x * bx[lane] - y * by[lane], x * by[lane] + y * bx[lane]
            bx[lane], by[lane] = scaled_x + k * along, scaled_y + k * across


@compiled
def _scale_series(series: Array, total: Array, work: Array) -> None:
    """Multiply coefficients by the powers of −r/δ, and add the logarithm to the first ones."""
    ratio_x, ratio_y, logarithms = work[4], work[5], work[6]
    power_x, power_y = work[7], work[8]
    for lane in range(_LANES):
        series[0, 0, lane] += (1.0 - logarithms[lane]) * total[0, lane]
        series[0, 1, lane] += (1.0 - logarithms[lane]) * total[1, lane]
        series[0, 2, lane] -= logarithms[lane] * total[2, lane]
        series[0, 3, lane] -= logarithms[lane] * total[3, lane]
    power_x[:] = 1.0
    power_y[:] = 0.0
    for k in range(1, series.shape[0]):
        ax, ay, bx, by = series[k, 0], series[k, 1], series[k, 2], series[k, 3]
        for lane in range(_LANES):
            x = power_x[lane] * ratio_x[lane] - power_y[lane] * ratio_y[lane]
            y = power_x[lane] * ratio_y[lane] + power_y[lane] * ratio_x[lane]
            power_x[lane], power_y[lane] = x, y
            scaled_x, scaled_y = x * ax[lane] - y * ay[lane], x * ay[lane] + y * ax[lane]
            ax[lane], ay[lane] = scaled_x, scaled_y
            scaled_x, scaled_y = x * bx[lane] - y * by[lane], x * by[lane] + y * bx[lane]
            bx[lane], by[lane] = scaled_x, scaled_y


@compiled
def add_velocities(
    points: Array, centers: Array, radii: Array, first: int, series: Array, orders: Indices, out: Array
) -> None:
    """Add the velocity that series about some vesicles have at their points.

    Parameters
    ----------
    points : (2, M, n)
    centers : (2, M)
    radii : (M,)
    first : int
        Number of the first of the m vesicles.
    series : (m, 4, ·)
        As of `add_series`.
    orders : (m,)
        Highest power of each.
    out : (2, m, n)
        Added to.
    """
    widest_vectors()
    scale = 1.0 / (8.0 * np.pi)
    n = points.shape[2]
    zx, zy, gx, gy, dx, dy, hx, hy = np.empty((8, n))
    for row in range(series.shape[0]):
        vesicle = first + row
        inverse = 1.0 / radii[vesicle]
        ax, ay, bx, by = series[row, 0], series[row, 1], series[row, 2], series[row, 3]
        for i in range(n):
            zx[i] = inverse * (points[0, vesicle, i] - centers[0, vesicle])
            zy[i] = inverse * (points[1, vesicle, i] - centers[1, vesicle])
            gx[i] = gy[i] = dx[i] = dy[i] = hx[i] = hy[i] = 0.0
        for k in range(orders[row], -1, -1):
            for i in range(n):
                x, y = zx[i], zy[i]
                derivative = x * dx[i] - y * dy[i] + gx[i]
                dy[i] = x * dy[i] + y * dx[i] + gy[i]
                dx[i] = derivative
                value = x * gx[i] - y * gy[i] + ax[k]
                gy[i] = x * gy[i] + y * gx[i] + ay[k]
                gx[i] = value
                other = x * hx[i] - y * hy[i] + bx[k]
                hy[i] = x * hy[i] + y * hx[i] + by[k]
                hx[i] = other
        own_x, own_y = out[0, row], out[1, row]
        for i in range(n):  # G − z Ḡ' + H̄
            own_x[i] += scale * (gx[i] + hx[i] - zx[i] * dx[i] - zy[i] * dy[i])
            own_y[i] += scale * (gy[i] - hy[i] - zy[i] * dx[i] + zx[i] * dy[i])
