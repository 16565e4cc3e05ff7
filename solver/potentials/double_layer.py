"""The double-layer potential of Stokes flow over all membranes, kept as a matrix.

It is D u(x) = 1/π ∫ (r·n) (r·u) r/r⁴ ds with r = x − y and the outward normal n (Pozrikidis 1992, section
2.3, in the plane).  It reproduces a rigid motion u with the factors 0 outside, −½ on the membrane and −1
inside.  In complex numbers, with t the tangent and w = conj(r)/r, integration by parts along the membrane
leaves

    D u = P u − i/(4π) conj ∫ w u' ds,    P u(x) = 1/(2π) ∫ (r·n)/r² u ds = 1/(2π) Im ∫ t u/r ds (u real),

that is, Laplace's double layer P of each component, and the integral that is the part of the single layer
without its logarithm (`close_evaluation`).  The matrix of the single layer holds w at any distance, so only P
is left to integrate.  On its own membrane P is smooth.  On another one it is integrated by the trapezoid rule
for targets that are a few spacings away, and by a barycentric Cauchy sum for those that are closer (Barnett,
Wu & Veerapaneni 2015).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.membrane.spectral import differentiation
from solver.potentials.close_evaluation import END, continuation_weights
from solver.potentials.quadrature import required_ratio

if TYPE_CHECKING:
    from solver.membrane.geometry import Geometry, Membranes
    from solver.potentials.proximity import Closeness

Array = NDArray[np.float64]


@compiled
def nearest(x: float, y: float, points: Array) -> int:
    """Return the index of the point that is nearest to (x, y).

    Parameters
    ----------
    x, y : float
    points : (2, n)

    Returns
    -------
    int
    """
    index, least = 0, np.inf
    for j in range(points.shape[1]):
        square = (x - points[0, j]) ** 2 + (y - points[1, j]) ** 2
        if square < least:
            index, least = j, square
    return index


@compiled
def laplace_double_layer(points: Array, tangents: Array, spacing: Array, out: Array) -> None:
    """Fill the trapezoid rule of P from all curves to their first points.

    P multiplies a constant by −½ on its own curve and by 0 outside.  The weight of the nearest source is
    chosen so that this is exact, and with it the factor of every rigid motion, however few the points: a
    large viscosity inside would magnify its error.

    Parameters
    ----------
    points, tangents : (2, C, n)
    spacing : (C,)
    out : (m, C·n)
        Written to, for the first m points.
    """
    count, n = points.shape[1], points.shape[2]
    for i in range(out.shape[0]):
        own = i // n
        xi, yi = points[0, own, i % n], points[1, own, i % n]
        for curve in range(count):
            scale = spacing[curve] / (2.0 * np.pi)
            row = out[i, curve * n : (curve + 1) * n]
            for j in range(n):
                dx = xi - points[0, curve, j]
                dy = yi - points[1, curve, j]
                across = tangents[1, curve, j] * dx - tangents[0, curve, j] * dy
                row[j] = scale * across / (dx * dx + dy * dy)
            if curve == own:
                row[i % n] = 0.0
                row[i % n] = -0.5 - row.sum()
            else:
                row[nearest(xi, yi, points[:, curve])] -= row.sum()


@compiled
def close_laplace_double_layer(
    targets: Array, points: Array, tangents: Array, spacing: float, differentiation: Array
) -> Array:
    """Return P of one membrane at targets outside it, however close to it they lie.

    ∫ t u/r ds has the limit Σ_{j≠i} h t_j (u_j − u_i)/(y_i − y_j) − h u'_i from outside, where the integral
    of a constant vanishes.  The limit is smooth, and is continued to the target.

    Parameters
    ----------
    targets : (2, m)
    points, tangents : (2, n)
        Equispaced in arclength, counterclockwise.
    spacing : float
    differentiation : (n, n)
        `spectral.differentiation`.

    Returns
    -------
    (m, n)
    """
    m, n = targets.shape[1], points.shape[1]
    limit = np.empty((2, n, n))  # real and imaginary part
    limit[0] = differentiation * (-2.0 * np.pi / n)
    limit[1] = 0.0
    for i in range(n):
        total_real = 0.0
        total_imaginary = 0.0
        for j in range(n):
            if i != j:
                dx = points[0, i] - points[0, j]
                dy = points[1, i] - points[1, j]
                inverse = spacing / (dx * dx + dy * dy)
                real = (tangents[0, j] * dx + tangents[1, j] * dy) * inverse
                imaginary = (tangents[1, j] * dx - tangents[0, j] * dy) * inverse
                limit[0, i, j] += real
                limit[1, i, j] += imaginary
                total_real += real
                total_imaginary += imaginary
        limit[0, i, i] -= total_real
        limit[1, i, i] -= total_imaginary
    weights = np.zeros((m, 2, n))
    offsets, work = np.empty((2, n)), np.empty((2, n))
    for i in range(m):
        start = nearest(targets[0, i], targets[1, i], points)
        step = complex(targets[0, i] - points[0, start], targets[1, i] - points[1, start])
        if step == 0:
            weights[i, 0, start] = 1.0
            continue
        for j in range(n):
            offsets[0, j] = points[0, j] - points[0, start]
            offsets[1, j] = points[1, j] - points[1, start]
        continuation_weights(offsets, tangents, spacing, step, 1.0 + 0.0j, END, work, weights[i])
    real, imaginary = np.ascontiguousarray(weights[:, 0]), np.ascontiguousarray(weights[:, 1])
    return (np.dot(real, limit[1]) + np.dot(imaginary, limit[0])) / (2.0 * np.pi)


@compiled
def double_layer_derivatives(
    points: Array,
    tangents: Array,
    spacing: Array,
    values: Array,
    derivatives: Array,
    by_points: Array,
    by_angle: Array,
) -> None:
    """Fill the derivatives of D u at the first m points by all points and by the tangents' angles.

    On every curve P is applied to the difference of u from its value nearest to the target.  P of a constant
    does not depend on the geometry, and what is left is not singular.

    Parameters
    ----------
    points, tangents : (2, C, n)
    spacing : (C,)
    values, derivatives : (2, C, n)
        The velocity u, and u' times the spacing; both are held fixed.
    by_points : (2, m, 2, C·n)
        Written to.
    by_angle : (2, m, C·n)
        Written to.
    """
    count, n = points.shape[1], points.shape[2]
    rotation = 1.0 / (2.0 * np.pi)
    for i in range(by_points.shape[1]):
        own = i // n
        xi, yi = points[0, own, i % n], points[1, own, i % n]
        for curve in range(count):
            near = nearest(xi, yi, points[:, curve])
            scale = spacing[curve] / (2.0 * np.pi)
            for j in range(n):
                dx = xi - points[0, curve, j]
                dy = yi - points[1, curve, j]
                r2 = dx * dx + dy * dy
                inverse = 1.0 / (r2 if r2 > 0.0 else np.inf)
                tx, ty = tangents[0, curve, j], tangents[1, curve, j]
                across = 2.0 * (ty * dx - tx * dy) * inverse
                by_dx = scale * (ty - across * dx) * inverse
                by_dy = scale * (-tx - across * dy) * inverse
                by_rotation = scale * (tx * dx + ty * dy) * inverse
                # w rotates with the angle of r.
                cosine = rotation * (dx * dx - dy * dy) * inverse
                sine = rotation * 2.0 * dx * dy * inverse
                gx, gy = derivatives[0, curve, j], derivatives[1, curve, j]
                whirl_x, whirl_y = cosine * gx + sine * gy, sine * gx - cosine * gy
                column = curve * n + j
                for component in range(2):
                    u = values[component, curve, j] - values[component, curve, near]
                    whirl = whirl_x if component == 0 else whirl_y
                    by_points[component, i, 0, column] = -(by_dx * u - whirl * dy * inverse)
                    by_points[component, i, 1, column] = -(by_dy * u + whirl * dx * inverse)
                    by_angle[component, i, column] = by_rotation * u
        for component in range(2):
            for coordinate in range(2):
                by_points[component, i, coordinate, i] -= by_points[component, i, coordinate].sum()
        tx, ty = tangents[0, own, i % n], tangents[1, own, i % n]
        cosine, sine = rotation * (tx * tx - ty * ty), rotation * 2.0 * tx * ty
        gx, gy = derivatives[0, own, i % n], derivatives[1, own, i % n]
        by_angle[0, i, i] += cosine * gx + sine * gy
        by_angle[1, i, i] += sine * gx - cosine * gy


class DoubleLayer:
    """Discrete double-layer potential, kept as a matrix.

    Parameters
    ----------
    membranes : Membranes
    accuracy : float
        Relative error allowed in the velocity that one vesicle causes on another.

    Attributes
    ----------
    matrix : (2·M·N, 2·M·N)
        From all x-components of u and then all y-components to those of D u; filled by `assemble`.  Images
        carry −u.
    """

    def __init__(self, membranes: Membranes, accuracy: float) -> None:
        self._ratio = required_ratio(1.0, accuracy)
        size = membranes.count * membranes.points
        self._laplace = np.empty((size, membranes.multiplicity * size))
        self.matrix = np.empty((2 * size, 2 * size))

    def assemble(self, geometry: Geometry, closeness: Closeness | None, single_layer: Array) -> None:
        """Fill the matrix for a geometry.

        Parameters
        ----------
        geometry : Geometry
        closeness : Closeness or None
            None for a single curve.
        single_layer : (2·M·N, 2·M·N)
            Matrix of `SingleLayer` for the same geometry.
        """
        membranes = geometry.membranes
        points, size = membranes.points, len(self._laplace)
        laplace_double_layer(
            geometry.curve_points,
            geometry.curve_tangents,
            membranes.curve_spacing,
            self._laplace,
        )
        if closeness:
            self._replace_close(geometry, closeness)
        laplace = membranes.fold(self._laplace)
        xx, xy, yy = single_layer[:size, :size], single_layer[:size, size:], single_layer[size:, size:]
        derivative = (2 * np.pi / points) * differentiation(points)  # spacing · ∂/∂s
        along = (2 * xy).reshape(-1, points) @ derivative
        across = (xx - yy).reshape(-1, points) @ derivative
        along, across = along.reshape(size, size), across.reshape(size, size)
        np.add(laplace, along, out=self.matrix[:size, :size])
        np.subtract(laplace, along, out=self.matrix[size:, size:])
        np.negative(across, out=self.matrix[:size, size:])
        self.matrix[size:, :size] = self.matrix[:size, size:]

    def jacobian(self, geometry: Geometry, velocity: Array) -> Array:
        """Return the derivatives of D u by the state at fixed u.

        Sources that are close to their targets are differentiated as if they were not.

        Parameters
        ----------
        geometry : Geometry
        velocity : (2, M, N)
            The velocity u.

        Returns
        -------
        (2, M·N, state_size)
        """
        membranes = geometry.membranes
        size = membranes.count * membranes.points
        by_points = np.empty((2, size, 2, membranes.multiplicity * size))
        by_angle = np.empty((2, size, membranes.multiplicity * size))
        slope = geometry.arclength_derivative(velocity) * membranes.spacing[:, None]
        double_layer_derivatives(
            geometry.curve_points,
            geometry.curve_tangents,
            membranes.curve_spacing,
            membranes.with_images(velocity, axis=1),
            membranes.with_images(slope, axis=1),
            by_points,
            by_angle,
        )
        by_state = geometry.by_state(membranes.fold(by_points))
        # An image rotates as its vesicle does.
        by_state[:, :, :size] += by_angle.reshape(2, size, membranes.multiplicity, size).sum(axis=2)
        return by_state

    def _replace_close(self, geometry: Geometry, closeness: Closeness) -> None:
        """Replace the rows of targets that are too close to a curve for the trapezoid rule."""
        membranes = geometry.membranes
        points = membranes.points
        matrix = differentiation(points)
        for target in range(membranes.count):
            for source in range(membranes.curves):
                rows = np.flatnonzero(closeness.distances[target, source] < self._ratio)
                if len(rows):
                    self._laplace[target * points + rows, source * points : (source + 1) * points] = (
                        close_laplace_double_layer(
                            geometry.points[:, target, rows],
                            np.ascontiguousarray(geometry.curve_points[:, source]),
                            np.ascontiguousarray(geometry.curve_tangents[:, source]),
                            membranes.curve_spacing[source],
                            matrix,
                        )
                    )
