"""Flows whose velocity gradient is the same everywhere."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from solver.flows.imposed_flow import Array, ImposedFlow


class LinearFlow(ImposedFlow):
    """Velocity rate·A x with a constant matrix A.

    Attributes
    ----------
    unit_gradient : (2, 2)
        The matrix A: the velocity gradient at a rate of 1.
    """

    unit_gradient: ClassVar[Array]
    odd: ClassVar[bool] = True

    def velocity(self, points: Array, centers: Array) -> Array:
        """Return the velocity at points.

        Parameters
        ----------
        points : (2, ...)
        centers : (2, C)
            Of all vesicles; a linear flow does not follow them.

        Returns
        -------
        (2, ...)
        """
        flat = points.reshape(2, -1)
        return np.asarray((self.rate * self.unit_gradient) @ flat).reshape(points.shape)

    def velocity_gradient(self, points: Array) -> Array:
        """Return the velocity gradient at points, the same at all.

        Parameters
        ----------
        points : (2, ...)

        Returns
        -------
        (2, 2, ...)
        """
        gradient = (self.rate * self.unit_gradient).reshape(2, 2, *(1 for _ in points.shape[1:]))
        return np.broadcast_to(gradient, (2, *points.shape))

    def jacobian(self, points: Array, by_state: Array, centers_by_state: Array) -> Array:
        """Return the derivatives of the velocity at points by the state.

        Parameters
        ----------
        points : (2, P)
        by_state : (2, P, S)
        centers_by_state : (2, C, S)

        Returns
        -------
        (2, P, S)
        """
        gradient = self.rate * self.unit_gradient
        return np.asarray(gradient @ by_state.reshape(2, -1)).reshape(by_state.shape)
