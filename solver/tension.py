"""Membrane tension from local inextensibility: x_s · u_s = 0.

A tension σ exerts the force (σ x_s)_s; the velocity it causes must cancel the stretching that all other
forces and the flow cause.  With T σ = (σ x_s)_s, S the single-layer potential and Div u = x_s · u_s,

    A σ = Div u₀,   A = −Div S T.

Since Div = −T* and S is symmetric and positive, so is A (weighted with the spacing): conjugate gradients,
preconditioned with the dense inverse from the last Jacobian.  That inverse stays good while the membranes
move, because A does not change when a membrane is turned or shifted.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from solver.geometry import Geometry
from solver.kernels import compiled
from solver.spectral import differentiation
from solver.stokes import SingleLayer

Array = NDArray[np.float64]

# Relative weight of the mean tension that keeps the inverse finite for a circle.  There a constant tension
# is a pressure and moves nothing, so its value does not matter; it must only not be divided by round-off.
_CIRCLE_SHIFT = 1e-13


class TensionNotFoundError(ArithmeticError):
    """The iteration for the tension did not converge."""


@compiled
def _conjugate_gradients(
    xx: Array,
    xy: Array,
    yy: Array,
    tangents: Array,
    derivative: Array,
    rate: Array,
    spacing: Array,
    inverse: Array,
    stretching: Array,
    tolerance: float,
    natural_rate: float,
    limit: int,
    tension: Array,
    velocity: Array,
) -> int:
    """Solve for the tension; return the number of iterations, or −1 if ``limit`` was not enough.

    ``derivative`` is the transposed differentiation matrix; ``rate`` (M, 1) = 2π/length; ``stretching``
    (M, N) is Div u₀, and ``natural_rate`` a stretching that counts as large.  ``velocity`` (2, M, N) is
    written with that caused by ``tension`` (M, N).
    """
    count, points = stretching.shape
    size = count * points
    residual = (stretching * spacing).reshape(size)
    weights = natural_rate * spacing
    natural = np.sqrt(points * np.sum(weights * weights))
    goal = tolerance * max(np.sqrt(np.dot(residual, residual)), natural)
    solution = np.zeros(size)
    flow_x, flow_y = np.zeros(size), np.zeros(size)
    direction = np.dot(inverse, residual)
    product = np.dot(residual, direction)
    tx, ty = tangents[0], tangents[1]
    iteration = 0
    while np.sqrt(np.dot(residual, residual)) > goal:
        if iteration == limit:
            return -1
        iteration += 1
        field = direction.reshape(count, points)
        fx = (np.dot(field * tx, derivative) * (rate * spacing)).reshape(size)
        fy = (np.dot(field * ty, derivative) * (rate * spacing)).reshape(size)
        ux = np.dot(xx, fx) + np.dot(xy, fy)
        uy = np.dot(xy, fx) + np.dot(yy, fy)
        ux_s = np.dot(ux.reshape(count, points), derivative)
        uy_s = np.dot(uy.reshape(count, points), derivative)
        image = (-(tx * ux_s + ty * uy_s) * (rate * spacing)).reshape(size)
        step = product / np.dot(direction, image)
        solution += step * direction
        flow_x += step * ux
        flow_y += step * uy
        residual -= step * image
        correction = np.dot(inverse, residual)
        previous = product
        product = np.dot(residual, correction)
        direction = correction + (product / previous) * direction
    tension[:] = solution.reshape(count, points)
    velocity[0] = flow_x.reshape(count, points)
    velocity[1] = flow_y.reshape(count, points)
    return iteration


class Inextensibility:
    """Finds the tension of all membranes, and the velocity it causes.

    Parameters
    ----------
    tolerance : float
        Stretching left over, relative to that without tension or to `Membranes.natural_rate` if that is
        larger: in a state of rest there is no other scale.
    """

    def __init__(self, tolerance: float) -> None:
        self.tolerance = tolerance
        self.iterations = 0
        self._inverse: Array | None = None

    def solve(self, layer: SingleLayer, geometry: Geometry, stretching: Array) -> tuple[Array, Array]:
        """Tension (M, N) and its velocity (2, M, N) that cancel ``stretching`` (M, N).

        Raises
        ------
        TensionNotFoundError
            If the iteration does not converge even with an inverse of this very geometry.
        """
        for inverse, limit in ((self._inverse, 25), (None, 200)):
            if inverse is None:
                self.factorize(layer, geometry)
            membranes = geometry.membranes
            tension, velocity = np.empty(stretching.shape), np.empty(geometry.tangents.shape)
            iterations = _conjugate_gradients(
                layer.xx,
                layer.xy,
                layer.yy,
                geometry.tangents,
                differentiation(membranes.points).T,
                2 * np.pi / membranes.length[:, None],
                membranes.spacing[:, None],
                self._inverse,
                stretching,
                self.tolerance,
                membranes.natural_rate,
                limit,
                tension,
                velocity,
            )
            if iterations >= 0:
                self.iterations += iterations
                return tension, velocity
        raise TensionNotFoundError("the tension could not be found: the membrane is too distorted")

    def factorize(self, layer: SingleLayer, geometry: Geometry) -> tuple[Array, Array, Array]:
        """Make the dense inverse for this geometry.

        Returns
        -------
        inverse : (M·N, M·N)
            Of A, weighted with the spacing.
        flow_x, flow_y : (M·N, M·N)
            S T, the velocity of each unit tension.
        """
        membranes = geometry.membranes
        points, count = membranes.points, membranes.count
        matrix = differentiation(points)
        flow_x, flow_y = np.empty((2, count * points, count * points))
        for source in range(count):
            block = slice(source * points, (source + 1) * points)
            weighted = (2 * np.pi / points) * matrix  # spacing · ∂/∂s
            xy = layer.xy[:, block] @ weighted
            tx, ty = geometry.tangents[:, source]
            flow_x[:, block] = (layer.xx[:, block] @ weighted) * tx + xy * ty
            flow_y[:, block] = xy * tx + (layer.yy[:, block] @ weighted) * ty
        system = -self.stretching(geometry, flow_x, flow_y)
        system *= np.repeat(membranes.spacing, points)[:, None]
        system = 0.5 * (system + system.T)
        shift = _CIRCLE_SHIFT * np.trace(system) / points
        for vesicle in range(count):
            block = slice(vesicle * points, (vesicle + 1) * points)
            system[block, block] += shift
        # Differentiation loses the highest mode; give its tension the weight of its neighbors.
        typical = np.trace(system) / (count * points)
        alternating = np.where(np.arange(points) % 2 == 0, 1.0, -1.0)
        for vesicle in range(count):
            block = slice(vesicle * points, (vesicle + 1) * points)
            system[block, block] += np.outer(alternating, alternating) * typical / points
        factor, failed = lapack.dpotrf(system, lower=1)
        if failed:
            raise TensionNotFoundError("the tension operator is not positive: the membrane is too distorted")
        lower, _ = lapack.dpotri(factor, lower=1)
        self._inverse = np.tril(lower) + np.tril(lower, -1).T
        return self._inverse, flow_x, flow_y

    @staticmethod
    def stretching(geometry: Geometry, ux: Array, uy: Array) -> Array:
        """x_s · u_s for velocity components (M·N, columns)."""
        result = np.empty_like(ux)
        points = geometry.membranes.points
        matrix = differentiation(points)
        for vesicle in range(geometry.membranes.count):
            block = slice(vesicle * points, (vesicle + 1) * points)
            tx, ty = geometry.tangents[:, vesicle, :, None] * (2 * np.pi / geometry.membranes.length[vesicle])
            result[block] = tx * (matrix @ ux[block]) + ty * (matrix @ uy[block])
        return result
