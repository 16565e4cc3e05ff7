"""The velocity that a vesicle's point forces cause far from it, as series in powers of the distance.

In complex numbers, with z from the vesicle's center to the target and t to a source, point forces f cause

    4π u = Σ [−log|z − t| f + ½ f + ½ (z − t)/(z̄ − t̄) f̄].

Expanded in t/z this becomes three power series in w = 1/z̄, whose coefficients are the moments Σ f tᵏ, Σ f
t̄ᵏ and Σ t f̄ t̄ᵏ (Greengard, Kropinski & Mayo 1996).  Cut off after p terms they have the relative error
(largest |t|/|z|)^p.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.potentials.direct_sum import velocity as direct_velocity
from solver.potentials.logarithm import logarithm

Array = NDArray[np.float64]
Orders = NDArray[np.int64]

# Most terms of a series that is used; measured: one costs about as much as the sum over one point.
LARGEST_ORDER = 32


@compiled
def orders_between(points: Array, centers: Array, radii: Array, accuracy: float, out: Orders) -> None:
    """Write how many terms each vesicle needs of each other's series.

    Parameters
    ----------
    points : (2, M, N)
    centers : (2, M)
    radii : (M,)
        Of the circles about the centers that hold each vesicle's points.
    accuracy : float
        Relative.
    out : (M, M)
        Written to, by target and source; 0 where a series of `LARGEST_ORDER` terms is not accurate enough.
    """
    needed = -np.log(accuracy)
    nearest = np.empty(radii.size)
    for target in range(out.shape[0]):
        nearest[:] = np.inf
        for i in range(points.shape[2]):
            for source in range(radii.size):
                dx = points[0, target, i] - centers[0, source]
                dy = points[1, target, i] - centers[1, source]
                nearest[source] = min(nearest[source], dx * dx + dy * dy)
        for source in range(radii.size):
            decay = 0.5 * np.log(nearest[source]) - np.log(radii[source])
            serves = source != target and decay * LARGEST_ORDER >= needed
            out[target, source] = max(2, int(np.ceil(needed / decay))) if serves else 0


@compiled
def write_coefficients(points: Array, centers: Array, first: int, point_forces: Array, out: Array) -> None:
    """Write the coefficients of the series of some vesicles.

    These are real and imaginary parts of three series: of the one whose conjugate is added, of the one that
    is added as it is, and of the one that is added times z.  In place of the first one's coefficient of w⁰
    stands the total force.

    Parameters
    ----------
    points : (2, M, N)
    centers : (2, M)
    first : int
        Number of the first of the m vesicles.
    point_forces : (2, m, N)
        On these.
    out : (m, 6, p + 1)
        Written to, up to the power p.
    """
    n, last = points.shape[2], out.shape[2] - 1
    tx, ty, product_x, product_y, power_x, power_y = np.empty((6, n))
    for row in range(out.shape[0]):
        force_x, force_y = point_forces[0, row], point_forces[1, row]
        for i in range(n):
            tx[i] = points[0, first + row, i] - centers[0, first + row]
            ty[i] = points[1, first + row, i] - centers[1, first + row]
            product_x[i] = tx[i] * force_x[i] + ty[i] * force_y[i]  # t f̄
            product_y[i] = ty[i] * force_x[i] - tx[i] * force_y[i]
            power_x[i] = 1.0
            power_y[i] = 0.0
        series = out[row]
        series[:2, last] = 0.0
        series[2:, 0] = 0.0
        for k in range(last):
            xx = xy = yx = yy = 0.0
            product_along = product_across = 0.0
            for i in range(n):
                xx += force_x[i] * power_x[i]
                yy += force_y[i] * power_y[i]
                xy += force_x[i] * power_y[i]
                yx += force_y[i] * power_x[i]
                product_along += product_x[i] * power_x[i] + product_y[i] * power_y[i]
                product_across += product_y[i] * power_x[i] - product_x[i] * power_y[i]
                next_x = power_x[i] * tx[i] - power_y[i] * ty[i]
                power_y[i] = power_x[i] * ty[i] + power_y[i] * tx[i]
                power_x[i] = next_x
            # Σ f tᵏ = (xx − yy) + i (xy + yx) and Σ f t̄ᵏ = (xx + yy) + i (yx − xy)
            if k == 0:
                series[0, 0], series[1, 0] = xx - yy, xy + yx
            else:
                series[0, k], series[1, k] = (xx - yy) / (2 * k), -(xy + yx) / (2 * k)
                series[2, k] += (xx + yy) / (2 * k)
                series[3, k] += (yx - xy) / (2 * k)
            series[2, k + 1], series[3, k + 1] = -0.5 * product_along, -0.5 * product_across
            series[4, k + 1], series[5, k + 1] = 0.5 * (xx - yy), -0.5 * (xy + yx)


@compiled
def _series(real: Array, imaginary: Array, order: int, wx: Array, wy: Array, x: Array, y: Array) -> None:
    """Write Σ cₖ wᵏ for k = 1 … order to x + iy, from the real and imaginary parts of the coefficients."""
    for i in range(x.size):
        x[i] = 0.0
        y[i] = 0.0
    for k in range(order, 0, -1):
        cx, cy = real[k], imaginary[k]
        for i in range(x.size):
            sum_x, sum_y = x[i] + cx, y[i] + cy
            x[i] = sum_x * wx[i] - sum_y * wy[i]
            y[i] = sum_x * wy[i] + sum_y * wx[i]


@compiled
def add_series(
    targets: Array, center_x: float, center_y: float, coefficients: Array, order: int, work: Array, out: Array
) -> None:
    """Add the velocity that the series of one vesicle give at targets.

    Parameters
    ----------
    targets : (2, n)
    center_x, center_y : float
        Of the vesicle.
    coefficients : (6, ·)
        As of `write_coefficients`.
    order : int
        Number of terms.
    work : (6, n)
        Overwritten.
    out : (2, n)
        Added to.
    """
    scale = 1.0 / (4.0 * np.pi)
    zx, zy, wx, wy, x, y = work[0], work[1], work[2], work[3], work[4], work[5]
    out_x, out_y = out[0], out[1]
    force_x, force_y = coefficients[0, 0], coefficients[1, 0]
    for i in range(zx.size):
        zx[i] = targets[0, i] - center_x
        zy[i] = targets[1, i] - center_y
        square = zx[i] * zx[i] + zy[i] * zy[i]
        isotropic = scale * (0.5 - 0.5 * logarithm(square))
        out_x[i] += isotropic * force_x
        out_y[i] += isotropic * force_y
        wx[i] = zx[i] / square  # 1/z̄ = z/|z|²
        wy[i] = zy[i] / square
    _series(coefficients[0], coefficients[1], order, wx, wy, x, y)
    for i in range(zx.size):
        out_x[i] += scale * x[i]
        out_y[i] -= scale * y[i]
    _series(coefficients[2], coefficients[3], order, wx, wy, x, y)
    for i in range(zx.size):
        out_x[i] += scale * x[i]
        out_y[i] += scale * y[i]
    _series(coefficients[4], coefficients[5], order, wx, wy, x, y)
    for i in range(zx.size):
        out_x[i] += scale * (zx[i] * x[i] - zy[i] * y[i])
        out_y[i] += scale * (zx[i] * y[i] + zy[i] * x[i])


@compiled
def velocity(
    points: Array,
    point_forces: Array,
    centers: Array,
    coefficients: Array,
    orders: Orders,
    first: int,
    result: Array,
) -> None:
    """Add the velocity of some vesicles that the point forces on all of them cause.

    It is summed by series, or directly where these are not accurate enough.

    Parameters
    ----------
    points : (2, M, N)
    point_forces : (M, 2, N)
    centers : (2, M)
    coefficients : (M, 6, ·)
        As of `write_coefficients`.
    orders : (m, M)
        Rows of `orders_between`.
    first : int
        Number of the first of the m vesicles.
    result : (2, m, N)
        Added to.
    """
    count, n = points.shape[1], points.shape[2]
    sources, forces = np.empty((2, count * n)), np.empty((2, count * n))
    work = np.empty((6, n))
    for row in range(result.shape[1]):
        targets = np.ascontiguousarray(points[:, first + row])
        used = 0
        for source in range(count):
            if orders[row, source] == 0:
                for component in range(2):
                    for i in range(n):
                        sources[component, used + i] = points[component, source, i]
                        forces[component, used + i] = point_forces[source, component, i]
                used += n
        part = direct_velocity(
            targets, np.ascontiguousarray(sources[:, :used]), np.ascontiguousarray(forces[:, :used])
        )
        for source in range(count):
            order = orders[row, source]
            if order > 0:
                add_series(
                    targets, centers[0, source], centers[1, source], coefficients[source], order, work, part
                )
        result[:, row] += part
