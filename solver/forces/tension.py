"""Membrane tension from local inextensibility, x_s · u_s = 0 (Quaife et al. 2019, eq. 1).

A tension σ exerts the force (σ x_s)_s; the velocity it causes must cancel the stretching that all other
forces and the flow cause.  With T σ = (σ x_s)_s, S the single-layer potential and Div u = x_s · u_s,

    A σ = Div u₀,   A = −Div S T.

Since Div = −T* and S is symmetric and positive, so is A (weighted with the spacing): conjugate gradients,
preconditioned with the dense inverse from the last Jacobian.  That inverse stays good while the membranes
move, because A does not change when a membrane is rotated or shifted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from solver.compilation import compiled
from solver.membrane.products import multiply, multiply_both
from solver.membrane.spectral import differentiation

if TYPE_CHECKING:
    from solver.membrane.geometry import Geometry

Array = NDArray[np.float64]

ROUND_OFF = 1e-15  # the least elasticity (`Inextensibility`) that rounding leaves a meaning


class TensionNotFoundError(ArithmeticError):
    """The iteration for the tension did not converge."""


class Mobility(Protocol):
    """How point forces move the membranes: the single-layer potential, or what a contrast makes of it.

    Attributes
    ----------
    matrix : (2·M·N, 2·M·N)
        From point forces to velocities, x-components first; symmetric up to quadrature error.
    """

    matrix: Array


class Inextensible(NamedTuple):
    """A motion that does not stretch the membranes.

    Attributes
    ----------
    tension : (M, N)
        What achieves it.
    velocity : (2, M, N)
        With that tension.
    rotation_rate : (M, N)
        n · u_s, how fast the material turns.
    """

    tension: Array
    velocity: Array
    rotation_rate: Array


class TensionInverse(NamedTuple):
    """The inverse of A in one geometry, which preconditions the search for the tension in others.

    Attributes
    ----------
    matrix : (M·N, M·N)
        Weighted with the spacing.
    shifts : (M,)
        What times the mean tension of each vesicle was added to A σ.
    """

    matrix: Array
    shifts: Array


class TensionEffect(NamedTuple):
    """What each unit tension causes.

    Attributes
    ----------
    velocity : (2, M·N, M·N)
        S T.
    turning : (M·N, M·N)
        n · u_s of that velocity.
    """

    velocity: Array
    turning: Array


@compiled
def _stretching(velocity: Array, tangents: Array, derivative: Array, out: Array) -> None:
    """Write x_s · u_s of a velocity (2·M·N,), times the length over 2π, as (M·N,)."""
    _, count, points = tangents.shape
    by_x, by_y = np.empty(points), np.empty(points)
    for vesicle in range(count):
        first, second = vesicle * points, (count + vesicle) * points
        x, y = velocity[first : first + points], velocity[second : second + points]
        multiply_both(derivative, x, y, by_x, by_y)
        for j in range(points):
            out[first + j] = tangents[0, vesicle, j] * by_x[j] + tangents[1, vesicle, j] * by_y[j]


@compiled
def _turning(velocity: Array, tangents: Array, derivative: Array, wavenumber: Array, out: Array) -> None:
    """Write n · u_s of a velocity (2·M·N,) as (M·N,)."""
    _, count, points = tangents.shape
    by_x, by_y = np.empty(points), np.empty(points)
    for vesicle in range(count):
        first, second = vesicle * points, (count + vesicle) * points
        x, y = velocity[first : first + points], velocity[second : second + points]
        multiply_both(derivative, x, y, by_x, by_y)
        for j in range(points):
            turned = tangents[0, vesicle, j] * by_y[j] - tangents[1, vesicle, j] * by_x[j]
            out[first + j] = wavenumber[vesicle, 0] * turned


@compiled
def _point_forces(tension: Array, tangents: Array, derivative: Array, forces: Array) -> None:
    """Write the forces (2·M·N,) of a tension (M·N,) at the points: (σ x_s)_s times the spacing."""
    _, count, points = tangents.shape
    pull_x, pull_y = np.empty(points), np.empty(points)
    for vesicle in range(count):
        first, second = vesicle * points, (count + vesicle) * points
        for j in range(points):
            pull_x[j] = tension[first + j] * tangents[0, vesicle, j]
            pull_y[j] = tension[first + j] * tangents[1, vesicle, j]
        by_x, by_y = forces[first : first + points], forces[second : second + points]
        multiply_both(derivative, pull_x, pull_y, by_x, by_y)
        for j in range(points):
            by_x[j] *= 2.0 * np.pi / points
            by_y[j] *= 2.0 * np.pi / points


@compiled
def _respond(
    layer: Array,
    tangents: Array,
    derivative: Array,
    shifts: Array,
    tension: Array,
    forces: Array,
    velocity: Array,
    response: Array,
) -> None:
    """Write the point forces and the velocity (2·M·N,) of a tension σ (M·N,), and A σ."""
    _, count, points = tangents.shape
    _point_forces(tension, tangents, derivative, forces)
    multiply(layer, forces, velocity)
    _stretching(velocity, tangents, derivative, response)
    for vesicle in range(count):
        first = vesicle * points
        shift = shifts[vesicle] * tension[first : first + points].mean()
        for i in range(first, first + points):
            response[i] = shift - response[i] * 2.0 * np.pi / points


@compiled
def _conjugate_gradients(
    layer: Array,
    tangents: Array,
    derivative: Array,
    wavenumber: Array,
    inverse: Array,
    shifts: Array,
    tolerance: float,
    natural_rate: float,
    limit: int,
    imposed: Array,
    tension: Array,
    velocity: Array,
    rotation_rate: Array,
) -> int:
    """Write what `Inextensible` holds; return the number of iterations, or −1 if ``limit`` was not enough.

    ``layer`` is the matrix of the single-layer potential, ``derivative`` that of differentiation;
    ``wavenumber`` (M, 1) = 2π/length; ``shifts`` (M,) times the mean tension of each vesicle are added to
    A σ; ``imposed`` (2·M·N,) is the velocity u₀ without tension, and ``natural_rate`` a stretching that
    counts as large.
    """
    _, count, points = tangents.shape
    size = count * points
    weight = 2.0 * np.pi / points  # spacing · wavenumber
    natural = 0.0
    for vesicle in range(count):
        natural += points * (natural_rate * weight / wavenumber[vesicle, 0]) ** 2
    residual, direction = np.empty(size), np.empty(size)
    correction, response = np.empty(size), np.empty(size)
    forces, change = np.empty(2 * size), np.empty(2 * size)
    _stretching(imposed, tangents, derivative, residual)
    square = 0.0
    for i in range(size):
        residual[i] *= weight
        square += residual[i] * residual[i]
    goal = tolerance * tolerance * max(square, natural)
    for i in range(size):
        tension[i] = 0.0
    for i in range(2 * size):
        velocity[i] = imposed[i]
    product, iteration = np.inf, 0
    while square > goal:
        if iteration == limit:
            return -1
        iteration += 1
        multiply(inverse, residual, correction)
        previous, product = product, 0.0
        for i in range(size):
            product += residual[i] * correction[i]
        for i in range(size):
            direction[i] = correction[i] + (product / previous * direction[i] if iteration > 1 else 0.0)
        _respond(layer, tangents, derivative, shifts, direction, forces, change, response)
        curvature = 0.0
        for i in range(size):
            curvature += direction[i] * response[i]
        step = product / curvature
        square = 0.0
        for i in range(size):
            tension[i] += step * direction[i]
            residual[i] -= step * response[i]
            square += residual[i] * residual[i]
        for i in range(2 * size):
            velocity[i] += step * change[i]
    _turning(velocity, tangents, derivative, wavenumber, rotation_rate)
    return iteration


@compiled
def _complete_system(stretching: Array, spacing: Array, shifts: Array) -> None:
    """Make the matrix of A from the stretching (M·N, M·N) that unit tensions cause, in place.

    ``shifts`` (M,) are relative to a typical element on entry, and what was added on return.
    """
    size, points = stretching.shape[0], stretching.shape[0] // spacing.size
    trace = 0.0
    for i in range(size):
        row, scale = stretching[i], -spacing[i // points]
        for j in range(size):
            row[j] *= scale
        trace += row[i]
    typical = trace / size
    for vesicle in range(spacing.size):
        shifts[vesicle] *= typical
        first = vesicle * points
        for i in range(points):
            # Differentiation loses the highest mode, whose tension gets the weight of its neighbors.
            alternating = typical if i % 2 == 0 else -typical
            own = stretching[first + i, first : first + points]
            for j in range(0, points, 2):
                own[j] += (shifts[vesicle] + alternating) / points
                own[j + 1] += (shifts[vesicle] - alternating) / points


@compiled
def _mirror(matrix: Array) -> None:
    """Fill the upper triangle of a symmetric matrix from the lower one."""
    for i in range(matrix.shape[0]):
        for j in range(i):
            matrix[j, i] = matrix[i, j]


class Inextensibility:
    """Finds the tension of all membranes, and the motion with it.

    Parameters
    ----------
    tolerance : float
        Stretching left over, relative to that without tension or to `Membranes.natural_rate` if that is
        larger: in a state of rest there is no other scale.
    elasticity : float
        How much a constant tension stretches a membrane, relative to a varying one.  On a nearly circular
        one it does next to nothing, and must not be divided by the error of the sums over other membranes.
        A vesicle whose ellipticity squared is below this gives way.  On a circular vesicle a constant
        tension is a pressure that moves nothing: it is projected out, and the tension has no mean.

    Attributes
    ----------
    iterations : int
        So far.
    """

    def __init__(self, tolerance: float, elasticity: float) -> None:
        self.tolerance = tolerance
        self.iterations = 0
        self._elasticity = elasticity

    def solve(
        self, layer: Mobility, geometry: Geometry, imposed: Array, known: TensionInverse | None = None
    ) -> tuple[Inextensible, TensionInverse]:
        """Find the motion when all forces but the tension, and the flow, cause a velocity.

        Parameters
        ----------
        layer : Mobility
            Assembled for the geometry.
        geometry : Geometry
        imposed : (2, M, N)
            That velocity.
        known : TensionInverse or None
            Of another geometry, preferably one like this.

        Returns
        -------
        Inextensible
        TensionInverse
            The one that was used: the known one, or that of this geometry if there was none or if the
            iteration with it was too slow.

        Raises
        ------
        TensionNotFoundError
            If the iteration does not converge even with the inverse of this very geometry.
        """
        membranes = geometry.membranes
        scalar, vector = geometry.tangent_angle.shape, geometry.points.shape
        motion = Inextensible(np.empty(scalar), np.empty(vector), np.empty(scalar))
        for inverse, limit in ((known, 25), (None, 200)):
            if inverse is None:
                inverse, _ = self.factorize(layer, geometry)
            iterations = _conjugate_gradients(
                layer.matrix,
                geometry.tangents,
                differentiation(membranes.points),
                membranes.wavenumber,
                inverse.matrix,
                inverse.shifts,
                self.tolerance,
                membranes.natural_rate,
                limit,
                imposed.ravel(),
                motion.tension.ravel(),
                motion.velocity.ravel(),
                motion.rotation_rate.ravel(),
            )
            if iterations >= 0:
                self.iterations += iterations
                return motion, inverse
        raise TensionNotFoundError("the tension could not be found: the membrane is too distorted")

    def factorize(self, layer: Mobility, geometry: Geometry) -> tuple[TensionInverse, TensionEffect]:
        """Make the inverse of A for a geometry.

        Parameters
        ----------
        layer : Mobility
            Assembled for the geometry.
        geometry : Geometry

        Returns
        -------
        TensionInverse
        TensionEffect
            Of each unit tension.

        Raises
        ------
        TensionNotFoundError
            If A is not positive, because a membrane is too distorted.
        """
        membranes = geometry.membranes
        points, count = membranes.points, membranes.count
        weighted = (2 * np.pi / points) * differentiation(points)  # spacing · ∂/∂s
        by_vesicle = np.empty((2, count * points, count, points))
        columns = layer.matrix.reshape(-1, 2, count, points)
        for vesicle in range(count):
            forces = (weighted * geometry.tangents[:, vesicle, None]).reshape(2 * points, points)
            own = columns[:, :, vesicle].reshape(-1, 2 * points)
            by_vesicle[:, :, vesicle] = (own @ forces).reshape(2, -1, points)
        flow = by_vesicle.reshape(2, count * points, -1)
        system, turning = geometry.deformation(flow)
        shifts = np.where(membranes.circular, 1.0, self._elasticity)
        _complete_system(system, membranes.spacing, shifts)
        # Only the lower triangle is used: the operator is symmetric up to quadrature error.
        factor, failed = lapack.dpotrf(system.T, lower=0, overwrite_a=1)
        if failed:
            raise TensionNotFoundError("the tension operator is not positive: the membrane is too distorted")
        inverse = lapack.dpotri(factor, lower=0, overwrite_c=1)[0].T
        _mirror(inverse)
        return TensionInverse(inverse, shifts), TensionEffect(flow, turning)
