"""The equation of motion: how tangent angles and centers change.

The membranes move with the fluid, u = u_∞ + S[f_bending + f_adhesion + f_tension], and do not stretch.  In
tangent angle and center that reads θ_t = n · u_s and c_t = mean(u).  Where the fluid inside a vesicle has
another viscosity than that outside, both terms of u are changed (`contrast`).

`DenseEquation.of` is the one place where a scene becomes the terms that it has.  What a scene does not have is
never constructed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from solver.flows import ImposedFlow
from solver.forces.adhesion import Adhesion
from solver.forces.bending import Bending
from solver.forces.tension import ROUND_OFF, Inextensibility
from solver.forces.truncated_adhesion import TruncatedAdhesion
from solver.membrane.geometry import Geometry, Membranes
from solver.membrane.spectral import differentiation, highest_modes, integration
from solver.membrane.symmetry import independent_vesicles
from solver.membrane.tangential_velocity import (
    add_tangential_motion,
    tangential_speed,
    tangential_speed_by_curvature,
    tangential_speed_weights,
)
from solver.parallel import SERIAL, Parallel
from solver.potentials.proximity import Closeness, Proximity
from solver.potentials.single_layer import SingleLayer
from solver.potentials.viscosity_contrast import ViscosityContrast, contrasts
from solver.scene import Adhesion as AdhesionParameters
from solver.scene import Numerics, Scene

Array = NDArray[np.float64]


def accuracy_of(numerics: Numerics) -> float:
    """Of sums and iterations; so far below the time integrator's that they do not limit its step."""
    return float(np.clip(1e-3 * numerics.tolerance, 1e-12, 1e-7))


@dataclass(frozen=True)
class Motion:
    """Everything known about one instant.

    velocity : (2, M, N); turning : n · u_s, (M, N); tension : (M, N)
    bending, adhesion : force densities (2, M, N)
    closeness : None for a single curve; adhesion : None for a scene without
    """

    geometry: Geometry
    closeness: Proximity | None
    velocity: Array
    rotation_rate: Array
    tension: Array
    bending: Array
    adhesion: Array | None


def state_change(motion: Motion) -> Array:
    """How a state changes whose motion this is, (state_size,); see `DenseEquation.rate`."""
    rotation_rate = motion.rotation_rate.copy()
    points = rotation_rate.shape[1]
    add_tangential_motion(motion.geometry.curvature, rotation_rate, highest_modes(points))
    return np.concatenate([rotation_rate.ravel(), motion.velocity.sum(axis=2).ravel() / points])


def _adhesion(
    parameters: AdhesionParameters | None, accuracy: float, membranes: Membranes, parallel: Parallel
) -> Adhesion | None:
    """The adhesion that several vesicles have."""
    if parameters is None:
        return None
    if parameters.cutoff is not None:
        return TruncatedAdhesion(parameters, accuracy, membranes, parallel)
    return Adhesion(parameters, accuracy, parallel)


@dataclass
class DenseEquation:
    """Right-hand side and Jacobian of the equation of motion.

    ``adhesion``, ``flow`` and ``contrast`` are None for a scene without.
    """

    membranes: Membranes
    bending: Bending
    adhesion: Adhesion | None
    flow: ImposedFlow | None
    inextensibility: Inextensibility
    layer: SingleLayer
    contrast: ViscosityContrast | None = None
    evaluations: int = field(default=0, init=False)

    @classmethod
    def of(cls, scene: Scene, parallel: Parallel = SERIAL) -> Self:
        """The terms of a scene, computed together by these ranks."""
        membranes = Membranes.of_scene(scene)
        several = membranes.curves > 1
        accuracy = accuracy_of(scene.numerics)
        contrast = contrasts(independent_vesicles(scene))
        differ = bool(np.any(contrast != 1))
        return cls(
            membranes=membranes,
            bending=Bending(),
            adhesion=_adhesion(scene.adhesion, accuracy, membranes, parallel) if several else None,
            flow=scene.flow,
            inextensibility=Inextensibility(accuracy, 1e-3 * accuracy if several else ROUND_OFF),
            layer=SingleLayer(membranes, accuracy, parallel),
            contrast=ViscosityContrast(contrast, membranes, accuracy) if differ else None,
        )

    def motion(self, state: Array) -> Motion:
        """Velocity, tension and forces in a state."""
        self.evaluations += 1
        geometry, closeness = self._assemble(state)
        bending = self.bending.density(geometry)
        density = bending
        adhesion = None
        if self.adhesion and closeness:
            adhesion = self.adhesion.density(geometry, closeness)
            density = bending + adhesion
        velocity = self.layer.velocity(density * self.membranes.spacing[:, None])
        if self.flow:
            velocity += self.flow.velocity(geometry.points, geometry.curve_centers)
        if self.contrast:
            velocity = self.contrast.velocity(velocity)
        free = self.inextensibility.solve(self.contrast or self.layer, geometry, velocity)
        return Motion(geometry, closeness, free.velocity, free.rotation_rate, free.tension, bending, adhesion)

    def rate(self, state: Array) -> Array:
        """d(state)/dt.

        The two highest modes of the tangent angle stay as they are: their tangents alias onto a mode whose
        derivative vanishes, so that bending does not damp them and gliding would slowly fill them.
        """
        return self.rate_of(self.motion(state))

    def rate_of(self, motion: Motion) -> Array:
        """`rate` in the state of a motion."""
        return state_change(motion)

    def jacobian(self, state: Array) -> Array:
        """Derivative of `rate`, (state_size, state_size).

        Dropped is only the change of a refined quadrature with the points.
        """
        motion = self.motion(state)
        geometry = motion.geometry
        adhesion = None
        if self.adhesion and motion.closeness:
            adhesion = self.adhesion.jacobian(geometry, motion.closeness)
        return self.linearized(motion, adhesion)

    def linearized(self, motion: Motion, adhesion: Array | None) -> Array:
        """`jacobian` in the state of a motion, whose geometry was the last one assembled.

        ``adhesion``, (2, M·N, state), are the derivatives of its force density by the state, if there is any.
        """
        geometry = motion.geometry
        force = self.bending.jacobian(geometry)
        self._add_tension_turning(motion, force)
        if adhesion is not None:
            force += adhesion
        weights = np.repeat(self.membranes.spacing, self.membranes.points)[:, None]
        force *= weights
        velocity = self.layer.columns(force)
        velocity += self.layer.jacobian(geometry, self._point_forces(motion))
        if self.flow:
            velocity += self._flow_jacobian(self.flow, geometry)
        if self.contrast:
            velocity += self.contrast.jacobian(geometry, motion.velocity)
            velocity = self.contrast.velocity(velocity)
        stretching = self.inextensibility.stretching(geometry, velocity)
        every_point = np.arange(motion.rotation_rate.size)
        stretching[every_point, every_point] += motion.rotation_rate.ravel()
        stretching *= weights
        inverse, tension_flow = self.inextensibility.factorize(self.contrast or self.layer, geometry)
        velocity += tension_flow @ (inverse @ stretching)
        return self._rate_columns(motion, velocity)

    def _point_forces(self, motion: Motion) -> Array:
        """All forces at the points, (2, M, N)."""
        geometry = motion.geometry
        density = motion.bending + geometry.arclength_derivative(motion.tension * geometry.tangents)
        if motion.adhesion is not None:
            density += motion.adhesion
        return density * self.membranes.spacing[:, None]

    def _add_tension_turning(self, motion: Motion, force: Array) -> None:
        """Add what turning a membrane does to its tension's force, ∂/∂s (σ n δθ)."""
        points = self.membranes.points
        matrix = differentiation(points)
        geometry = motion.geometry
        for vesicle in range(self.membranes.count):
            block = slice(vesicle * points, (vesicle + 1) * points)
            scaled = motion.tension[vesicle] * (2 * np.pi / self.membranes.length[vesicle])
            tx, ty = geometry.tangents[:, vesicle]
            force[0, block, block] -= matrix * (scaled * ty)
            force[1, block, block] += matrix * (scaled * tx)

    def _assemble(self, state: Array) -> tuple[Geometry, Closeness | None]:
        geometry = Geometry(self.membranes, state)
        closeness = Closeness(geometry) if self.membranes.curves > 1 else None
        self.layer.assemble(geometry, closeness)
        if self.contrast:
            self.contrast.assemble(geometry, closeness, self.layer)
        return geometry, closeness

    def point_derivatives(self, geometry: Geometry) -> Array:
        """Derivatives of the points by the state, (2, M·N, state)."""
        count, points = self.membranes.count, self.membranes.points
        by_state = np.zeros((2, count * points, self.membranes.state_size))
        matrix = integration(points)
        for vesicle in range(count):
            block = slice(vesicle * points, (vesicle + 1) * points)
            scale = self.membranes.length[vesicle] / (2 * np.pi)
            np.multiply(matrix, -scale * geometry.tangents[1, vesicle], out=by_state[0, block, block])
            np.multiply(matrix, scale * geometry.tangents[0, vesicle], out=by_state[1, block, block])
            by_state[0, block, count * points + vesicle] = 1.0
            by_state[1, block, count * points + count + vesicle] = 1.0
        return by_state

    def _flow_jacobian(self, flow: ImposedFlow, geometry: Geometry) -> Array:
        """Derivatives of the imposed velocity at the points by the state, (2, M·N, state)."""
        count, size = self.membranes.count, self.membranes.state_size
        centers_by_state = np.zeros((2, count, size))
        for component in range(2):
            first = size - (2 - component) * count
            centers_by_state[component, :, first : first + count] = np.eye(count)
        return flow.jacobian(
            geometry.points.reshape(2, -1),
            self.point_derivatives(geometry),
            self.membranes.with_images(centers_by_state, axis=1),
        )

    def _rate_columns(self, motion: Motion, velocity: Array) -> Array:
        """`rate_of` for the derivatives of the velocity by the state, (2, M·N, columns)."""
        count, points = self.membranes.count, self.membranes.points
        geometry = motion.geometry
        result = np.empty((self.membranes.state_size, velocity.shape[2]))
        gradient = geometry.column_derivative(velocity)
        gradient *= geometry.normals.reshape(2, -1, 1)
        np.sum(gradient, axis=0, out=result[: count * points])
        curvature, highest = geometry.curvature, highest_modes(points)
        direction = tangential_speed_weights(curvature)
        speed = tangential_speed(curvature, motion.rotation_rate)
        by_curvature = tangential_speed_by_curvature(curvature, motion.rotation_rate)
        for vesicle in range(count):
            block = slice(vesicle * points, (vesicle + 1) * points)
            result[block] += np.outer(curvature[vesicle], direction[vesicle] @ result[block])
            to_curvature = self.membranes.wavenumber[vesicle] * differentiation(points)
            result[block, block] += speed[vesicle] * to_curvature
            result[block, block] += np.outer(curvature[vesicle], by_curvature[vesicle] @ to_curvature)
            result[block] -= highest @ (highest.T @ result[block])
        result[count * points :] = velocity.reshape(2 * count, points, -1).mean(axis=1)
        return result
