"""Tension of many membranes: conjugate gradients as in `solver.tension`, with sums instead of a matrix.

The preconditioner is each vesicle's own inverse.  The iteration begins with the tension found last.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.geometry import Geometry
from solver.spectral import differentiation
from solver.suspension.single_layer import SummedSingleLayer
from solver.tension import Inextensible, TensionNotFoundError

Array = NDArray[np.float64]

_LIMIT = 100  # iterations; measured: 4 to 8 are usual


class Preconditioner:
    """What each vesicle's tension does to itself.

    Parameters
    ----------
    inverses : (M, N, N)
        `Inextensibility.inverse` of each vesicle alone.
    shifts : (M,)
        What times the mean tension is added on each, `Inextensibility.shift`.
    """

    def __init__(self, inverses: Array, shifts: Array) -> None:
        self._inverses = inverses
        self.shifts = shifts[:, None]

    def __call__(self, residual: Array) -> Array:
        """Tensions (M, N) that would remove this residual (M, N) if each vesicle were alone."""
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
        self._last: Array | None = None

    def solve(
        self,
        layer: SummedSingleLayer,
        geometry: Geometry,
        preconditioner: Preconditioner,
        point_forces: Array,
        flow: Array | None,
    ) -> Inextensible:
        """The motion under point forces without tension, (2, M, N), in a flow of velocity (2, M, N).

        Raises
        ------
        TensionNotFoundError
            If the iteration does not converge.
        """
        membranes = geometry.membranes
        tangents, shifts = geometry.tangents, preconditioner.shifts
        derivative = (2 * np.pi / membranes.points) * differentiation(membranes.points).T  # spacing · ∂/∂s

        def stretching(velocity: Array) -> Array:
            gradient = velocity @ derivative
            return np.asarray(tangents[0] * gradient[0] + tangents[1] * gradient[1])

        def pull(tension: Array) -> Array:
            return np.asarray((tension * tangents) @ derivative)

        tension = np.zeros(tangents.shape[1:]) if self._last is None else self._last.copy()
        velocity = layer.velocity(point_forces + pull(tension))
        if flow is not None:
            velocity += flow
        residual = stretching(velocity) - shifts * tension.mean(axis=1, keepdims=True)
        natural = membranes.natural_rate * np.sqrt(membranes.points * np.sum(membranes.spacing**2))
        goal = self.tolerance * max(float(np.linalg.norm(velocity @ derivative)), float(natural))
        direction = preconditioner(residual)
        product = np.sum(residual * direction)
        for _ in range(_LIMIT):
            if np.linalg.norm(residual) <= goal:
                break
            self.iterations += 1
            change = layer.velocity(pull(direction))
            image = shifts * direction.mean(axis=1, keepdims=True) - stretching(change)
            step = product / np.sum(direction * image)
            tension += step * direction
            velocity += step * change
            residual -= step * image
            correction = preconditioner(residual)
            previous, product = product, np.sum(residual * correction)
            direction = correction + (product / previous) * direction
        else:
            raise TensionNotFoundError("the tension could not be found: the membranes are too distorted")
        self._last = tension
        gradient = membranes.wavenumber * (velocity @ differentiation(membranes.points).T)
        turning = tangents[0] * gradient[1] - tangents[1] * gradient[0]
        return Inextensible(tension.copy(), velocity, turning)
