"""Tension of many membranes: conjugate gradients as in `Inextensibility`, with sums instead of a matrix.

The preconditioner is each vesicle's own inverse.  The iteration begins with a tension known from before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.forces.tension import Inextensible, TensionNotFoundError
from solver.membrane.spectral import differentiation

if TYPE_CHECKING:
    from solver.membrane.geometry import Geometry, Membranes
    from solver.parallel import Shares
    from solver.potentials.summed_single_layer import SummedSingleLayer

Array = NDArray[np.float64]

_LIMIT = 100  # iterations; measured: 4 to 8 are usual


class Preconditioner(NamedTuple):
    """What each vesicle's tension does to itself: `TensionInverse` of each vesicle by itself.

    Attributes
    ----------
    inverses : (M, N, N)
    shifts : (M, 1)
        What times the mean tension is added on each.
    """

    inverses: Array
    shifts: Array


@compiled
def _response(tangents: Array, shifts: Array, tension: Array, gradient: Array) -> Array:
    """Return the mean of each tension (m, N) times its shift, minus the stretching of its velocity."""
    response = np.empty_like(tension)
    for vesicle in range(tension.shape[0]):
        shift = shifts[vesicle, 0] * tension[vesicle].mean()
        for i in range(tension.shape[1]):
            stretching = tangents[0, vesicle, i] * gradient[0, vesicle, i]
            stretching += tangents[1, vesicle, i] * gradient[1, vesicle, i]
            response[vesicle, i] = shift - stretching
    return response


def _products(shares: Shares, *pairs: tuple[Array, Array]) -> Array:
    """Return the products of fields (m, N), summed over all points of all vesicles.  Collective."""
    sums = [np.einsum("ij,ij->i", first, second) for first, second in pairs]
    return shares.gather(np.stack(sums, axis=1)).sum(axis=0)


class _OwnOperator:
    """The operator A and its preconditioner on the vesicles of this rank."""

    def __init__(self, layer: SummedSingleLayer, geometry: Geometry, preconditioner: Preconditioner) -> None:
        own, points = layer.shares.own, geometry.membranes.points
        self._inverses, self._shifts = preconditioner.inverses[own], preconditioner.shifts[own]
        self._derivative = (2 * np.pi / points) * differentiation(points).T  # spacing · ∂/∂s
        self.tangents = geometry.tangents[:, own]
        self.spacing = geometry.membranes.spacing[own, None]

    def pull(self, tension: Array) -> Array:
        """Return the point forces (2, m, N) of a tension (m, N)."""
        return np.asarray((tension * self.tangents) @ self._derivative)

    def gradient(self, velocity: Array) -> Array:
        """Return spacing · ∂u/∂s of a velocity (2, m, N)."""
        return np.asarray(velocity @ self._derivative)

    def response(self, tension: Array, velocity: Array) -> Array:
        """Return A σ, if the tension σ alone causes the velocity; otherwise A σ − Div u₀ (m, N)."""
        return np.asarray(_response(self.tangents, self._shifts, tension, self.gradient(velocity)))

    def precondition(self, residual: Array) -> Array:
        """Return the correction of the tension for a residual (m, N)."""
        return np.asarray((self._inverses @ residual[:, :, None])[:, :, 0])


class SummedInextensibility:
    """Finds the tension of all membranes, and the motion with it.

    Parameters
    ----------
    tolerance : float
        Stretching left over, relative to the rate at which velocities vary along the membranes, or to
        `Membranes.natural_rate` if that is larger.
    """

    def __init__(self, tolerance: float) -> None:
        self.tolerance = tolerance
        self.iterations = 0

    def solve(
        self,
        layer: SummedSingleLayer,
        geometry: Geometry,
        preconditioner: Preconditioner,
        density: Array,
        flow: Array | None,
        guess: Array | None,
    ) -> Inextensible:
        """Find the motion under forces without tension, in a flow.

        Each rank iterates on its share of the vesicles; sums over all of them are made in the same order on
        every rank.

        Parameters
        ----------
        layer : SummedSingleLayer
            Assembled for the geometry.
        geometry : Geometry
        preconditioner : Preconditioner
            Of a geometry like this one.
        density : (2, M, N)
            Force per length without tension.
        flow : (2, M, N) or None
            Imposed velocity.
        guess : (M, N) or None
            Tension with which the iteration begins; zero without.

        Returns
        -------
        Inextensible

        Raises
        ------
        TensionNotFoundError
            If the iteration does not converge.
        """
        membranes, shares = geometry.membranes, layer.shares
        operator = _OwnOperator(layer, geometry, preconditioner)
        own = shares.own
        tension = np.zeros(operator.tangents.shape[1:]) if guess is None else guess[own].copy()
        velocity = layer.velocity(density[:, own] * operator.spacing + operator.pull(tension))
        if flow is not None:
            velocity += flow[:, own]
        self._iterate(layer, membranes, operator, tension, velocity)
        gradient, tangents = operator.gradient(velocity), operator.tangents
        rotation_rate = (tangents[0] * gradient[1] - tangents[1] * gradient[0]) / operator.spacing
        velocity_x, velocity_y, rotation_rate, tension = shares.gather(
            np.stack([*velocity, rotation_rate, tension]), axis=1
        )
        return Inextensible(tension, np.stack([velocity_x, velocity_y]), rotation_rate)

    def _iterate(
        self,
        layer: SummedSingleLayer,
        membranes: Membranes,
        operator: _OwnOperator,
        tension: Array,
        velocity: Array,
    ) -> None:
        """Change the tension (m, N), and with it the velocity (2, m, N), until nothing stretches."""
        shares = layer.shares
        gradient = operator.gradient(velocity)
        residual = -operator.response(tension, velocity)
        direction = operator.precondition(residual)
        strain_x, strain_y, square, product = _products(
            shares,
            (gradient[0], gradient[0]),
            (gradient[1], gradient[1]),
            (residual, residual),
            (residual, direction),
        )
        natural = membranes.natural_rate**2 * membranes.points * np.sum(membranes.spacing**2)
        goal = self.tolerance**2 * max(strain_x + strain_y, natural)
        for _ in range(_LIMIT):
            if square <= goal:
                return
            self.iterations += 1
            change = layer.velocity(operator.pull(direction))
            response = operator.response(direction, change)
            step = product / _products(shares, (direction, response))[0]
            tension += step * direction
            velocity += step * change
            residual -= step * response
            correction = operator.precondition(residual)
            previous = product
            square, product = _products(shares, (residual, residual), (residual, correction))
            direction = correction + (product / previous) * direction
        raise TensionNotFoundError("the tension could not be found: the membranes are too distorted")
