"""The membranes of a scene at one instant, as the arrays that every term works on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from solver.scene import Vesicle
from solver.spectral import differentiation, integration

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Membranes:
    """What stays the same during a run: M vesicles with N points each.

    length, bending_modulus : (M,)
    """

    points: int
    length: Array
    bending_modulus: Array

    @classmethod
    def of(cls, vesicles: Sequence[Vesicle], points: int) -> Self:
        """The membranes of these vesicles, sampled at ``points`` points each."""
        return cls(
            points,
            np.array([vesicle.length for vesicle in vesicles]),
            np.array([vesicle.bending_modulus for vesicle in vesicles]),
        )

    @property
    def count(self) -> int:
        """Number of vesicles."""
        return len(self.length)

    @property
    def spacing(self) -> Array:
        """Arclength between neighboring points, (M,)."""
        return self.length / self.points

    @cached_property
    def natural_rate(self) -> float:
        """Slowest rate at which bending acts on a vesicle's own scale, modulus/(length/2π)³ (viscosity 1)."""
        return float(np.min(self.bending_modulus * (2 * np.pi / self.length) ** 3))

    @property
    def state_size(self) -> int:
        """Length of the state vector: per vesicle N tangent angles and 2 coordinates of the center."""
        return self.count * (self.points + 2)

    def pack(self, tangent_angle: Array, center: Array) -> Array:
        """State vector of tangent angles (M, N) and centers (M, 2)."""
        return np.concatenate([tangent_angle.ravel(), center.T.ravel()])

    def tangent_angle(self, state: Array) -> Array:
        """Tangent angles (..., M, N) of states (..., state_size)."""
        size = self.count * self.points
        return state[..., :size].reshape(*state.shape[:-1], self.count, self.points)

    def center(self, state: Array) -> Array:
        """Centers (..., M, 2) of states (..., state_size)."""
        size = self.count * self.points
        return state[..., size:].reshape(*state.shape[:-1], 2, self.count).swapaxes(-1, -2)


class Geometry:
    """Points and tangents of all membranes in one state.

    Attributes
    ----------
    tangents, points : (2, M, N)
    """

    def __init__(self, membranes: Membranes, state: Array) -> None:
        tangent_angle = membranes.tangent_angle(state)
        self.membranes = membranes
        self.tangents = np.empty((2, *tangent_angle.shape))
        np.cos(tangent_angle, out=self.tangents[0])
        np.sin(tangent_angle, out=self.tangents[1])
        self.centers = state[tangent_angle.size :].reshape(2, membranes.count)
        scale = membranes.length[:, None] / (2 * np.pi)
        self.points = self.tangents @ integration(membranes.points).T
        self.points *= scale
        self.points += self.centers[:, :, None]

    @property
    def normals(self) -> Array:
        """Inward unit normals, (2, M, N)."""
        return np.stack([-self.tangents[1], self.tangents[0]])

    @cached_property
    def curvature(self) -> Array:
        """θ_s, (M, N); positive for a circle."""
        change = self.arclength_derivative(self.tangents)
        return self.tangents[0] * change[1] - self.tangents[1] * change[0]

    def arclength_derivative(self, values: Array, order: int = 1) -> Array:
        """∂^order/∂s^order of values (..., M, N)."""
        scale = (2 * np.pi / self.membranes.length[:, None]) ** order
        derivative: Array = values @ differentiation(self.membranes.points, order).T
        derivative *= scale
        return derivative
