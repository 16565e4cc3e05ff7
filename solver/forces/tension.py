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
def _conjugate_gradients(
    layer: Array,
    tangents: Array,
    derivative: Array,
    wavenumber: Array,
    spacing: Array,
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

    ``layer`` is the matrix of the single-layer potential, ``derivative`` the transposed one of
    differentiation; ``wavenumber`` (M, 1) = 2π/length; ``shifts`` (M,) times the mean tension of each vesicle
    are added to A σ; ``imposed`` (2, M, N) is the velocity u₀ without tension, and ``natural_rate`` a
    stretching that counts as large.
    """
    count, points = tension.shape
    size = count * points
    weight = wavenumber * spacing
    gradient = np.dot(imposed.reshape(2 * count, points), derivative).reshape(imposed.shape)
    residual = ((tangents[0] * gradient[0] + tangents[1] * gradient[1]) * weight).reshape(size)
    weights = natural_rate * spacing
    natural = np.sqrt(points * np.sum(weights * weights))
    goal = tolerance * max(np.sqrt(np.dot(residual, residual)), natural)
    solution = np.zeros(size)
    flow = imposed.copy().reshape(2 * size)
    direction = np.dot(inverse, residual)
    product = np.dot(residual, direction)
    iteration = 0
    while np.sqrt(np.dot(residual, residual)) > goal:
        if iteration == limit:
            return -1
        iteration += 1
        pull = (direction.reshape(count, points) * tangents).reshape(2 * count, points)
        forces = np.dot(pull, derivative).reshape(imposed.shape) * weight
        change = np.dot(layer, forces.reshape(2 * size))
        gradient = np.dot(change.reshape(2 * count, points), derivative).reshape(imposed.shape)
        response = (-(tangents[0] * gradient[0] + tangents[1] * gradient[1]) * weight).reshape(size)
        for vesicle in range(count):
            own = slice(vesicle * points, (vesicle + 1) * points)
            response[own] += shifts[vesicle] * direction[own].mean()
        step = product / np.dot(direction, response)
        solution += step * direction
        flow += step * change
        residual -= step * response
        correction = np.dot(inverse, residual)
        previous = product
        product = np.dot(residual, correction)
        direction = correction + (product / previous) * direction
    tension[:] = solution.reshape(count, points)
    velocity[:] = flow.reshape(imposed.shape)
    gradient = np.dot(flow.reshape(2 * count, points), derivative).reshape(imposed.shape)
    rotation_rate[:] = wavenumber * (tangents[0] * gradient[1] - tangents[1] * gradient[0])
    return iteration


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
        for inverse, limit in ((known, 25), (None, 200)):
            if inverse is None:
                inverse, _ = self.factorize(layer, geometry)
            membranes = geometry.membranes
            motion = Inextensible(
                np.empty(imposed.shape[1:]), np.empty(imposed.shape), np.empty(imposed.shape[1:])
            )
            iterations = _conjugate_gradients(
                layer.matrix,
                geometry.tangents,
                differentiation(membranes.points).T,
                membranes.wavenumber,
                membranes.spacing[:, None],
                inverse.matrix,
                inverse.shifts,
                self.tolerance,
                membranes.natural_rate,
                limit,
                imposed,
                *motion,
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
        system *= -np.repeat(membranes.spacing, points)[:, None]
        typical = np.trace(system) / (count * points)
        shifts = typical * np.where(membranes.circular, 1.0, self._elasticity)
        # Differentiation loses the highest mode, whose tension gets the weight of its neighbors.
        alternating = np.where(np.arange(points) % 2 == 0, 1.0, -1.0)
        highest = typical * np.outer(alternating, alternating)
        for vesicle in range(count):
            block = slice(vesicle * points, (vesicle + 1) * points)
            system[block, block] += (shifts[vesicle] + highest) / points
        # Only the lower triangle is used: the operator is symmetric up to quadrature error.
        factor, failed = lapack.dpotrf(system.T, lower=0, overwrite_a=1)
        if failed:
            raise TensionNotFoundError("the tension operator is not positive: the membrane is too distorted")
        triangle, _ = lapack.dpotri(factor, lower=0, overwrite_c=1)  # the other one holds zeros
        inverse = np.add(triangle, triangle.T, order="C")
        inverse.flat[:: len(inverse) + 1] = np.diagonal(triangle)
        return TensionInverse(inverse, shifts), TensionEffect(flow, turning)
