"""The membranes of a scene at one instant, as the arrays that every term works on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.membrane import curve
from solver.membrane.products import multiply, multiply_both
from solver.membrane.spectral import differentiation, integration
from solver.membrane.symmetry import independent_vesicles

if TYPE_CHECKING:
    from solver.scene import Scene, Vesicle

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Membranes:
    """What stays the same during a run: M vesicles with N points each, and perhaps their images.

    With the multiplicity 2 every vesicle has an image (`solver.membrane.symmetry`).  The C = multiplicity·M
    curves in the fluid are the vesicles and then the images, in the same order.

    Attributes
    ----------
    points : int
        N, on each vesicle.
    length, bending_modulus : (M,)
    circular : (M,) of bool
        Which vesicles are circles and have a viscosity contrast.  Without a contrast
        round-off leaves the tension operator of a circle positive, and nothing is to be projected out.
    multiplicity : int
        1, or 2 with images.
    """

    points: int
    length: Array
    bending_modulus: Array
    circular: NDArray[np.bool_]
    multiplicity: int = 1

    @classmethod
    def of(cls, vesicles: Sequence[Vesicle], points: int, multiplicity: int = 1) -> Self:
        """Make the membranes of these vesicles.

        Parameters
        ----------
        vesicles : sequence of Vesicle
        points : int
            On each vesicle.
        multiplicity : int
            1, or 2 with images.

        Returns
        -------
        Membranes
        """
        return cls(
            points,
            np.array([vesicle.length for vesicle in vesicles]),
            np.array([vesicle.bending_modulus for vesicle in vesicles]),
            np.array([v.is_circle and v.viscosity_contrast != 1 for v in vesicles]),
            multiplicity,
        )

    @classmethod
    def of_scene(cls, scene: Scene) -> Self:
        """Make the membranes that have to be computed for a scene.

        Parameters
        ----------
        scene : Scene
            With a number of points.

        Returns
        -------
        Membranes

        Raises
        ------
        ValueError
            If `numerics.points` is "auto".
        """
        return cls.of_some(independent_vesicles(scene), scene)

    @classmethod
    def of_some(cls, vesicles: Sequence[Vesicle], scene: Scene) -> Self:
        """Make the membranes if some of a scene's vesicles are computed.

        Parameters
        ----------
        vesicles : sequence of Vesicle
            All of the scene, or those of which the others are images.
        scene : Scene
            With a number of points.

        Returns
        -------
        Membranes

        Raises
        ------
        ValueError
            If `numerics.points` is "auto".
        """
        points = scene.numerics.points
        if points == "auto":
            raise ValueError(
                "numerics.points is 'auto', expected a number (`solver.simulation.resolution` chooses it)"
            )
        return cls.of(vesicles, points, len(scene.vesicles) // len(vesicles))

    @cached_property
    def count(self) -> int:
        """Number of vesicles."""
        return len(self.length)

    @property
    def curves(self) -> int:
        """Number of vesicles and images."""
        return self.multiplicity * self.count

    @cached_property
    def spacing(self) -> Array:
        """Arclength between neighboring points, (M,)."""
        return self.length / self.points

    @cached_property
    def curve_spacing(self) -> Array:
        """`spacing` of all curves, (C,)."""
        return np.tile(self.spacing, self.multiplicity)

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
        """Return the state vector.

        Parameters
        ----------
        tangent_angle : (M, N)
        center : (M, 2)

        Returns
        -------
        (state_size,)
        """
        return np.concatenate([tangent_angle.ravel(), center.T.ravel()])

    def tangent_angle(self, state: Array) -> Array:
        """Return the tangent angles in states.

        Parameters
        ----------
        state : (..., state_size)

        Returns
        -------
        (..., M, N)
            A view.
        """
        size = self.count * self.points
        return state[..., :size].reshape(*state.shape[:-1], self.count, self.points)

    def center(self, state: Array) -> Array:
        """Return the centers in states.

        Parameters
        ----------
        state : (..., state_size)

        Returns
        -------
        (..., M, 2)
            A view.
        """
        coordinates = self.center_coordinates(state)
        return coordinates.reshape(*state.shape[:-1], 2, self.count).swapaxes(-1, -2)

    def center_coordinates(self, state: Array) -> Array:
        """Return the coordinates of the centers in states, as they lie there.

        Parameters
        ----------
        state : (..., state_size)

        Returns
        -------
        (..., 2·M)
            All x, then all y; a view.
        """
        first = self.count * self.points
        return state[..., first : first + 2 * self.count]  # a clock may follow

    def curve_tangent_angle(self, state: Array) -> Array:
        """Return the tangent angles of all curves.

        Parameters
        ----------
        state : (..., state_size)

        Returns
        -------
        (..., C, N)
        """
        angle = self.tangent_angle(state)
        return np.concatenate([angle, angle + np.pi], axis=-2) if self.multiplicity == 2 else angle

    def curve_center(self, state: Array) -> Array:
        """Return the centers of all curves.

        Parameters
        ----------
        state : (..., state_size)

        Returns
        -------
        (..., C, 2)
        """
        return self.with_images(self.center(state), axis=-2)

    def with_images(self, vectors: Array, axis: int) -> Array:
        """Append to vectors on the vesicles the opposite ones on the images.

        Parameters
        ----------
        vectors : (..., M, ...)
        axis : int
            Of the vesicles.

        Returns
        -------
        (..., C, ...)
        """
        return np.concatenate([vectors, -vectors], axis=axis) if self.multiplicity == 2 else vectors

    def fold(self, columns: Array) -> Array:
        """Make operators that act on vectors on the vesicles from those that act on all curves.

        The images carry the opposite vectors.

        Parameters
        ----------
        columns : (..., C·N)

        Returns
        -------
        (..., M·N)
        """
        size = self.count * self.points
        return columns[..., :size] - columns[..., size:] if self.multiplicity == 2 else columns


@compiled
def _place(
    tangent_angle: Array,
    centers: Array,
    wavenumber: Array,
    integration: Array,
    differentiation: Array,
    curvature: Array,
    tangents: Array,
    points: Array,
    curve_tangents: Array,
    curve_points: Array,
) -> None:
    """Write the arrays of `Geometry`: curvature, tangents and points, of the vesicles and of all curves."""
    count, n = tangent_angle.shape
    periodic = np.empty(n)
    for vesicle in range(count):
        for j in range(n):
            periodic[j] = tangent_angle[vesicle, j] - 2.0 * np.pi * j / n
        multiply(differentiation, periodic, curvature[vesicle])
        for j in range(n):
            curvature[vesicle, j] = wavenumber[vesicle, 0] * (1.0 + curvature[vesicle, j])
        tx, ty = tangents[0, vesicle], tangents[1, vesicle]
        for j in range(n):
            tx[j], ty[j] = np.cos(tangent_angle[vesicle, j]), np.sin(tangent_angle[vesicle, j])
        multiply_both(integration, tx, ty, points[0, vesicle], points[1, vesicle])
        for component in range(2):
            own = points[component, vesicle]
            for j in range(n):
                own[j] = own[j] / wavenumber[vesicle, 0] + centers[component, vesicle]
    if curve_points.shape[1] == count:
        return
    for component in range(2):
        for vesicle in range(count):
            for j in range(n):
                curve_tangents[component, vesicle, j] = tangents[component, vesicle, j]
                curve_tangents[component, count + vesicle, j] = -tangents[component, vesicle, j]
                curve_points[component, vesicle, j] = points[component, vesicle, j]
                curve_points[component, count + vesicle, j] = -points[component, vesicle, j]


@compiled
def _differentiate(values: Array, matrix: Array, wavenumber: Array, order: int, derivative: Array) -> None:
    """Write the derivatives (k, M, N) of values by arclength, with the matrix of differentiation."""
    for k in range(values.shape[0]):
        for vesicle in range(values.shape[1]):
            own, scale = derivative[k, vesicle], wavenumber[vesicle, 0] ** order
            multiply(matrix, values[k, vesicle], own)
            for j in range(own.size):
                own[j] *= scale


@compiled
def _combine_by_state(
    by_points: Array, integrated: Array, tangents: Array, wavenumber: Array, result: Array
) -> None:
    """Write `Geometry.by_state` of derivatives and their integrals along the membranes."""
    _, count, points = tangents.shape
    for component in range(2):
        for row in range(result.shape[1]):
            by_state = result[component, row]
            by_x, by_y = by_points[component, row, 0], by_points[component, row, 1]
            of_x, of_y = integrated[component, row, 0], integrated[component, row, 1]
            for vesicle in range(count):
                first, scale = vesicle * points, 1.0 / wavenumber[vesicle, 0]
                tx, ty = tangents[0, vesicle], tangents[1, vesicle]
                own = by_state[first : first + points]
                own_x, own_y = of_x[first : first + points], of_y[first : first + points]
                for j in range(points):
                    own[j] = scale * (tx[j] * own_y[j] - ty[j] * own_x[j])
                total_x = total_y = 0.0
                for j in range(first, first + points):
                    total_x += by_x[j]
                    total_y += by_y[j]
                by_state[count * points + vesicle] = total_x
                by_state[count * (points + 1) + vesicle] = total_y


@compiled
def _add_rotation(matrix: Array, scale: Array, tangents: Array, out: Array) -> None:
    """Add what `Geometry.add_rotation` adds."""
    count, points = scale.shape
    for vesicle in range(count):
        first = vesicle * points
        tx, ty, own_scale = tangents[0, vesicle], tangents[1, vesicle], scale[vesicle]
        for i in range(points):
            row = matrix[i]
            of_x, of_y = out[0, first + i, first : first + points], out[1, first + i, first : first + points]
            for j in range(points):
                scaled = row[j] * own_scale[j]
                of_x[j] -= scaled * ty[j]
                of_y[j] += scaled * tx[j]


@compiled
def _combine_gradient(
    gradient: Array, tangents: Array, wavenumber: Array, stretching: Array, turning: Array
) -> None:
    """Write a `Deformation` from derivatives (2, M·N, columns) along the membranes."""
    points = tangents.shape[2]
    for i in range(stretching.shape[0]):
        vesicle, j = i // points, i % points
        tx = tangents[0, vesicle, j] * wavenumber[vesicle, 0]
        ty = tangents[1, vesicle, j] * wavenumber[vesicle, 0]
        along_x, along_y = gradient[0, i], gradient[1, i]
        stretched, turned = stretching[i], turning[i]
        for column in range(along_x.size):
            stretched[column] = tx * along_x[column] + ty * along_y[column]
            turned[column] = tx * along_y[column] - ty * along_x[column]


@compiled
def _radii(points: Array, centers: Array) -> Array:
    """Make the `Geometry.radii` of points (2, M, N) about centers (2, M)."""
    radii = np.empty(points.shape[1])
    for vesicle in range(radii.size):
        dx, dy = points[0, vesicle] - centers[0, vesicle], points[1, vesicle] - centers[1, vesicle]
        radii[vesicle] = np.sqrt(np.max(dx * dx + dy * dy))
    return radii


class Deformation(NamedTuple):
    """How velocities u deform the membranes.

    Attributes
    ----------
    stretching : (M·N, columns)
        x_s · u_s.
    turning : (M·N, columns)
        n · u_s.
    """

    stretching: Array
    turning: Array


class Geometry:
    """Points and tangents of all membranes in one state.

    Parameters
    ----------
    membranes : Membranes
    state : (state_size,)

    Attributes
    ----------
    tangent_angle : (M, N)
    centers : (2, M)
    curvature : (M, N)
        θ_s; positive for a circle.
    tangents, points : (2, M, N)
    curve_tangents, curve_points : (2, C, N)
        With the images.
    """

    def __init__(self, membranes: Membranes, state: Array) -> None:
        self.membranes = membranes
        shape = membranes.count, membranes.points
        size = membranes.count * membranes.points
        self.tangent_angle = state[:size].reshape(shape)
        self.centers = state[size:].reshape(2, membranes.count)
        self.curvature = np.empty(shape)
        self.tangents, self.points = np.empty((2, 2, *shape))
        self.curve_tangents, self.curve_points = self.tangents, self.points
        if membranes.multiplicity > 1:
            self.curve_tangents, self.curve_points = np.empty((2, 2, membranes.curves, membranes.points))
        _place(
            self.tangent_angle,
            self.centers,
            membranes.wavenumber,
            integration(membranes.points),
            differentiation(membranes.points),
            self.curvature,
            self.tangents,
            self.points,
            self.curve_tangents,
            self.curve_points,
        )

    @property
    def normals(self) -> Array:
        """Inward unit normals, (2, M, N)."""
        return np.stack([-self.tangents[1], self.tangents[0]])

    @property
    def curve_centers(self) -> Array:
        """The centers of all curves, (2, C)."""
        return self.membranes.with_images(self.centers, axis=1)

    @cached_property
    def radii(self) -> Array:
        """Of the circles about the centers that hold each vesicle's points, (M,)."""
        return np.asarray(_radii(self.points, self.centers))

    @cached_property
    def areas(self) -> Array:
        """Enclosed by each vesicle, (M,)."""
        points, tangents = self.points.swapaxes(0, 1), self.tangents.swapaxes(0, 1)
        return curve.area(points, tangents, self.membranes.length)

    def arclength_derivative(self, values: Array, order: int = 1) -> Array:
        """Differentiate by arclength.

        Parameters
        ----------
        values : (..., M, N)
        order : int

        Returns
        -------
        (..., M, N)
        """
        derivative = np.empty(values.shape)
        membranes = self.membranes
        shape = -1, membranes.count, membranes.points
        matrix = differentiation(membranes.points, order)
        _differentiate(values.reshape(shape), matrix, membranes.wavenumber, order, derivative.reshape(shape))
        return derivative

    def by_state(self, by_points: Array) -> Array:
        """Turn derivatives by the points into derivatives by the state.

        A tangent angle moves all points of its vesicle, x_θ = ∫(−sin θ, cos θ) ds; a center moves them alike.

        Parameters
        ----------
        by_points : (2, rows, 2, M·N)

        Returns
        -------
        (2, rows, state_size)
        """
        points, rows = self.membranes.points, by_points.shape[1]
        result = np.empty((2, rows, self.membranes.state_size))
        integrated = (by_points.reshape(-1, points) @ integration(points)).reshape(by_points.shape)
        _combine_by_state(by_points, integrated, self.tangents, self.membranes.wavenumber, result)
        return result

    def add_rotation(self, matrix: Array, scale: Array, out: Array) -> None:
        """Add the derivative of a matrix times (scale · tangents) by the state: tangents rotate.

        Parameters
        ----------
        matrix : (N, N)
        scale : (M, N)
        out : (2, M·N, state_size)
            Changed in place.
        """
        _add_rotation(matrix, scale, self.tangents, out)

    def deformation(self, velocity: Array) -> Deformation:
        """Return how velocities deform the membranes.

        Parameters
        ----------
        velocity : (2, M·N, columns)
            Each column is a velocity at all points.

        Returns
        -------
        Deformation
        """
        count, points = self.membranes.count, self.membranes.points
        gradient = (differentiation(points) @ velocity.reshape(2, count, points, -1)).reshape(velocity.shape)
        deformation = Deformation(*np.empty((2, *velocity.shape[1:])))
        _combine_gradient(gradient, self.tangents, self.membranes.wavenumber, *deformation)
        return deformation
