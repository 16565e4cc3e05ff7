"""Imposed flows.  All are linear: a velocity gradient and, for the trap, a stagnation point that follows."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from solver import scene
from solver.membrane.geometry import Geometry, Membranes

Array = NDArray[np.float64]

_SHEAR = np.array([[0.0, 1.0], [0.0, 0.0]])
_EXTENSION = np.array([[-1.0, 0.0], [0.0, 1.0]])


class ImposedFlow(Protocol):
    """A far-field velocity."""

    def velocity(self, geometry: Geometry) -> Array:
        """Velocity at the membranes' points, (2, M, N)."""

    def jacobian(self, by_state: Array) -> Array:
        """Derivatives of the velocity, given those of the points, (2, M·N, state) each."""


class LinearFlow:
    """Velocity ∇u·x with a constant gradient, (2, 2)."""

    def __init__(self, gradient: Array) -> None:
        self.gradient = gradient

    def velocity(self, geometry: Geometry) -> Array:
        """See `ImposedFlow`."""
        points = geometry.points
        return (self.gradient @ points.reshape(2, -1)).reshape(points.shape)

    def jacobian(self, by_state: Array) -> Array:
        """See `ImposedFlow`."""
        return np.tensordot(self.gradient, by_state, axes=1)


class TrapFlow:
    """Velocity ∇u·(x − X), X the mean of the vesicles' centers (a controlled stagnation point)."""

    def __init__(self, gradient: Array) -> None:
        self.linear = LinearFlow(gradient)

    def velocity(self, geometry: Geometry) -> Array:
        """See `ImposedFlow`."""
        stagnation = geometry.centers.mean(axis=1)
        return self.linear.velocity(geometry) - (self.linear.gradient @ stagnation)[:, None, None]

    def jacobian(self, by_state: Array) -> Array:
        """See `ImposedFlow`.

        The points' derivatives have the centers' as their mean, so the mean over all points is that of X.
        """
        return self.linear.jacobian(by_state - by_state.mean(axis=1, keepdims=True))


def velocity_gradient(flow: scene.Flow) -> Array:
    """∇u of a flow, (2, 2): row i holds the derivatives of the velocity's component i."""
    return flow.rate * (_SHEAR if isinstance(flow, scene.Shear) else _EXTENSION)


def imposed_flow(flow: scene.Flow, membranes: Membranes) -> ImposedFlow:
    """The flow that a scene asks for."""
    gradient = velocity_gradient(flow)
    # Vesicles and their images have the origin as their mean.
    if isinstance(flow, scene.Trap) and membranes.copies == 1:
        return TrapFlow(gradient)
    return LinearFlow(gradient)
