"""Flows whose velocity gradient is the same everywhere."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from solver.flows.imposed_flow import Array, ImposedFlow


class UniformGradient(ImposedFlow):
    """Velocity rate·A x with a constant matrix A."""

    odd: ClassVar[bool] = True

    @property
    @abstractmethod
    def unit_gradient(self) -> Array:
        """The matrix A, (2, 2): the velocity gradient at a rate of 1."""

    def velocity(self, points: Array, centers: Array) -> Array:
        """Return the velocity at points.

        Parameters
        ----------
        points : (2, ...)
        centers : (2, C)
            Of all vesicles; the flow does not follow them.

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


class FollowingFlow(UniformGradient):
    """Velocity rate·A (x − X) about the mean X of the vesicles' centers."""

    def velocity(self, points: Array, centers: Array) -> Array:
        """Return the velocity at points.

        Parameters
        ----------
        points : (2, ...)
        centers : (2, C)
            Of all vesicles; the velocity vanishes at their mean.

        Returns
        -------
        (2, ...)
        """
        stagnation = centers.mean(axis=1).reshape(2, *(1 for _ in points.shape[1:]))
        return super().velocity(points, centers) - super().velocity(stagnation, centers)

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
        relative = by_state - centers_by_state.mean(axis=1, keepdims=True)
        return super().jacobian(points, relative, centers_by_state)
