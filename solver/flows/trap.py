"""A fluid trap: extension that follows the vesicles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np

from solver.flows.imposed_flow import Array, Symbol
from solver.flows.linear import LinearFlow


class Trap(LinearFlow):
    """Velocity rate·(−(x − X), y − Y) about the mean (X, Y) of the vesicles' centers.

    The controlled stagnation point of (Quaife et al. 2019, section IV).
    """

    kind: Literal["trap"] = "trap"

    title: ClassVar[str] = "a fluid trap"
    symbols: ClassVar[Mapping[str, Symbol]] = {"rate": Symbol("extension rate", r"\dot{\epsilon}", "ε̇")}
    strains: ClassVar[bool] = True
    unit_gradient: ClassVar[Array] = np.array([[-1.0, 0.0], [0.0, 1.0]])

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
