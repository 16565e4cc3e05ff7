"""The membranes of a scene at one instant, as the arrays that every term works on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from solver.scene import Scene, Vesicle
from solver.spectral import differentiation, integration
from solver.symmetry import independent_vesicles

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Membranes:
    """What stays the same during a run: M vesicles with N points each, and perhaps their images.

    With ``copies`` = 2 every vesicle has an image (`symmetry`).  The C = copies·M curves in the fluid are
    the vesicles and then the images, in the same order.

    length, bending_modulus : (M,)
    """

    points: int
    length: Array
    bending_modulus: Array
    copies: int = 1

    @classmethod
    def of(cls, vesicles: Sequence[Vesicle], points: int, copies: int = 1) -> Self:
        """The membranes of these vesicles, sampled at ``points`` points each."""
        return cls(
            points,
            np.array([vesicle.length for vesicle in vesicles]),
            np.array([vesicle.bending_modulus for vesicle in vesicles]),
            copies,
        )

    @classmethod
    def of_scene(cls, scene: Scene) -> Self:
        """The membranes that have to be computed for a scene."""
        vesicles = independent_vesicles(scene)
        return cls.of(vesicles, scene.numerics.points, len(scene.vesicles) // len(vesicles))

    @property
    def count(self) -> int:
        """Number of vesicles."""
        return len(self.length)

    @property
    def curves(self) -> int:
        """Number of vesicles and images."""
        return self.copies * self.count

    @property
    def spacing(self) -> Array:
        """Arclength between neighboring points, (M,)."""
        return self.length / self.points

    @property
    def curve_spacing(self) -> Array:
        """`spacing` of all curves, (C,)."""
        return np.tile(self.spacing, self.copies)

    @cached_property
    def wavenumber(self) -> Array:
        """2π/length, (M, 1)."""
        return 2 * np.pi / self.length[:, None]

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

    def curve_tangent_angle(self, state: Array) -> Array:
        """Tangent angles of all curves, (..., C, N)."""
        angle = self.tangent_angle(state)
        return np.concatenate([angle, angle + np.pi], axis=-2) if self.copies == 2 else angle

    def curve_center(self, state: Array) -> Array:
        """Centers of all curves, (..., C, 2)."""
        return self.with_images(self.center(state), axis=-2)

    def with_images(self, vectors: Array, axis: int) -> Array:
        """Vectors on the vesicles, and the opposite ones on the images, along the axis of the vesicles."""
        return np.concatenate([vectors, -vectors], axis=axis) if self.copies == 2 else vectors

    def fold(self, columns: Array) -> Array:
        """Linear operators (..., M·N) that act on vesicles alone, from those on all curves (..., C·N).

        What vectors on the images do is opposite to what the same vectors on the vesicles do.
        """
        size = self.count * self.points
        return columns[..., :size] - columns[..., size:] if self.copies == 2 else columns


class Geometry:
    """Points and tangents of all membranes in one state.

    Attributes
    ----------
    tangents, points : (2, M, N)
    curve_tangents, curve_points : (2, C, N)
        With the images.
    """

    def __init__(self, membranes: Membranes, state: Array) -> None:
        tangent_angle = membranes.tangent_angle(state)
        self.membranes = membranes
        self.tangents = np.empty((2, *tangent_angle.shape))
        np.cos(tangent_angle, out=self.tangents[0])
        np.sin(tangent_angle, out=self.tangents[1])
        self.centers = state[tangent_angle.size :].reshape(2, membranes.count)
        self.points = (self.tangents.reshape(-1, membranes.points) @ integration(membranes.points).T).reshape(
            self.tangents.shape
        )
        self.points /= membranes.wavenumber
        self.points += self.centers[:, :, None]
        self.curve_tangents = membranes.with_images(self.tangents, axis=1)
        self.curve_points = membranes.with_images(self.points, axis=1)

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
        points = self.membranes.points
        derivative: Array = values.reshape(-1, points) @ differentiation(points, order).T
        derivative = derivative.reshape(values.shape)
        derivative *= self.membranes.wavenumber**order
        return derivative

    def by_state(self, by_x: Array, by_y: Array) -> Array:
        """Derivatives by the state, (rows, state_size), from those by the points' coordinates, (rows, M·N).

        A tangent angle moves all points of its vesicle, x_θ = ∫(−sin θ, cos θ) ds; a center moves them alike.
        """
        count, points = self.membranes.count, self.membranes.points
        size = count * points
        rows = by_x.shape[0]
        result = np.empty((rows, self.membranes.state_size))
        scaled_x, scaled_y = (self.tangents / self.membranes.wavenumber).reshape(2, -1)
        matrix = integration(points)
        turned = result[:, :size]
        np.multiply((by_y.reshape(-1, points) @ matrix).reshape(rows, size), scaled_x, out=turned)
        turned -= (by_x.reshape(-1, points) @ matrix).reshape(rows, size) * scaled_y
        result[:, size : size + count] = by_x.reshape(rows, count, points).sum(axis=2)
        result[:, size + count :] = by_y.reshape(rows, count, points).sum(axis=2)
        return result

    def column_derivative(self, values: Array) -> Array:
        """∂/∂s of the columns of values (M·N, columns)."""
        count, points = self.membranes.count, self.membranes.points
        derivative: Array = differentiation(points) @ values.reshape(count, points, -1)
        derivative *= self.membranes.wavenumber[:, :, None]
        return derivative.reshape(values.shape)
