"""Tension of many membranes: conjugate gradients as in `Inextensibility`, with sums instead of a matrix.

The preconditioner is each vesicle's own inverse.  The iteration begins with a tension known from before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.forces.tension import Inextensible, TensionNotFoundError
from solver.membrane.geometry import Geometry
from solver.membrane.spectral import differentiation
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
        own = shares.own
        tangents, spacing = geometry.tangents[:, own], membranes.spacing[own, None]
        inverses, shifts = preconditioner.inverses[own], preconditioner.shifts[own]
        derivative = (2 * np.pi / membranes.points) * differentiation(membranes.points).T  # spacing · ∂/∂s

        def pull(tension: Array) -> Array:
            return np.asarray((tension * tangents) @ derivative)

        def precondition(residual: Array) -> Array:
            return np.asarray((inverses @ residual[:, :, None])[:, :, 0])

        tension = np.zeros(tangents.shape[1:]) if guess is None else guess[own].copy()
        velocity = layer.velocity(density[:, own] * spacing + pull(tension))
        if flow is not None:
            velocity += flow[:, own]
        gradient = velocity @ derivative
        residual = -_response(tangents, shifts, tension, gradient)
        direction = precondition(residual)
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
                break
            self.iterations += 1
            change = layer.velocity(pull(direction))
            response = _response(tangents, shifts, direction, change @ derivative)
            step = product / _products(shares, (direction, response))[0]
            tension += step * direction
            velocity += step * change
            residual -= step * response
            correction = precondition(residual)
            previous = product
            square, product = _products(shares, (residual, residual), (residual, correction))
            direction = correction + (product / previous) * direction
        else:
            raise TensionNotFoundError("the tension could not be found: the membranes are too distorted")
        gradient = velocity @ derivative
        rotation_rate = (tangents[0] * gradient[1] - tangents[1] * gradient[0]) / spacing
        velocity_x, velocity_y, rotation_rate, tension = shares.gather(
            np.stack([*velocity, rotation_rate, tension]), axis=1
        )
        return Inextensible(tension, np.stack([velocity_x, velocity_y]), rotation_rate)
