"""The equation of motion: how tangent angles and centers change.

The membranes move with the fluid, u = u_∞ + S[f_bending + f_adhesion + f_tension], and do not stretch.  In
tangent angle and center that reads θ_t = n · u_s and c_t = mean(u).

`Dynamics.of` is the one place where a scene becomes the terms that it has.  What a scene does not have is
never constructed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from solver.adhesion import Adhesion
from solver.bending import Bending
from solver.flow import ImposedFlow, imposed_flow
from solver.geometry import Geometry, Membranes
from solver.proximity import Closeness
from solver.scene import Scene
from solver.spectral import differentiation, integration
from solver.stokes import SingleLayer
from solver.tension import Inextensibility

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """Everything known about one instant.

    velocity : (2, M, N); tension : (M, N); bending, adhesion : force densities (2, M, N)
    """

    geometry: Geometry
    velocity: Array
    tension: Array
    bending: Array
    adhesion: Array | None


@dataclass
class Dynamics:
    """Right-hand side and Jacobian of the equation of motion.

    ``adhesion`` and ``flow`` are None for a scene without.
    """

    membranes: Membranes
    bending: Bending
    adhesion: Adhesion | None
    flow: ImposedFlow | None
    inextensibility: Inextensibility
    layer: SingleLayer
    evaluations: int = field(default=0, init=False)

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """The terms of a scene."""
        membranes = Membranes.of(scene.vesicles, scene.numerics.points)
        several = membranes.count > 1
        # Below the time integrator's tolerance, so that neither sums nor iterations limit its step.
        quadrature = float(np.clip(1e-3 * scene.numerics.tolerance, 1e-12, 1e-7))
        iteration = float(np.clip(1e-4 * scene.numerics.tolerance, 1e-12, 1e-8))
        return cls(
            membranes=membranes,
            bending=Bending(),
            adhesion=Adhesion(scene.adhesion, quadrature) if scene.adhesion and several else None,
            flow=imposed_flow(scene.flow) if scene.flow else None,
            inextensibility=Inextensibility(iteration),
            layer=SingleLayer(membranes, quadrature),
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
            velocity += self.flow.velocity(geometry)
        gradient = geometry.arclength_derivative(velocity)
        stretching = geometry.tangents[0] * gradient[0] + geometry.tangents[1] * gradient[1]
        tension, correction = self.inextensibility.solve(self.layer, geometry, stretching)
        velocity += correction
        return Motion(geometry, velocity, tension, bending, adhesion)

    def rate(self, state: Array) -> Array:
        """d(state)/dt."""
        motion = self.motion(state)
        return self.rate_of(motion)

    def rate_of(self, motion: Motion) -> Array:
        """d(state)/dt of a motion."""
        geometry = motion.geometry
        gradient = geometry.arclength_derivative(motion.velocity)
        turning = geometry.tangents[0] * gradient[1] - geometry.tangents[1] * gradient[0]
        return np.concatenate([turning.ravel(), motion.velocity.mean(axis=2).ravel()])

    def jacobian(self, state: Array) -> Array:
        """Derivative of `rate` with the single-layer potential and the constraint's geometry held fixed.

        Shape (state_size, state_size).  Dropped are the derivatives of S, of the tension's direction and of
        the constraint; kept are those of all forces and of the flow, which carry the stiffness.
        """
        geometry, closeness = self._assemble(state)
        dx, dy = self._point_derivatives(geometry)
        force_x, force_y = self.bending.jacobian(geometry, dx, dy)
        if self.adhesion and closeness:
            adhesion_x, adhesion_y = self.adhesion.jacobian(geometry, closeness, dx, dy)
            force_x += adhesion_x
            force_y += adhesion_y
        weights = np.repeat(self.membranes.spacing, self.membranes.points)[:, None]
        force_x *= weights
        force_y *= weights
        ux, uy = self.layer.columns(force_x, force_y)
        if self.flow:
            flow_x, flow_y = self.flow.jacobian(dx, dy)
            ux += flow_x
            uy += flow_y
        inverse, tension_x, tension_y = self.inextensibility.factorize(self.layer, geometry)
        tension = inverse @ (weights * self.inextensibility.stretching(geometry, ux, uy))
        ux += tension_x @ tension
        uy += tension_y @ tension
        return self._rate_columns(geometry, ux, uy)

    def _assemble(self, state: Array) -> tuple[Geometry, Closeness | None]:
        geometry = Geometry(self.membranes, state)
        closeness = Closeness(geometry) if self.membranes.count > 1 else None
        self.layer.assemble(geometry, closeness)
        return geometry, closeness

    def _point_derivatives(self, geometry: Geometry) -> tuple[Array, Array]:
        """Derivatives of the points' coordinates by the state, (M·N, state) each."""
        count, points = self.membranes.count, self.membranes.points
        dx, dy = np.zeros((2, count * points, self.membranes.state_size))
        matrix = integration(points)
        for vesicle in range(count):
            block = slice(vesicle * points, (vesicle + 1) * points)
            scale = self.membranes.length[vesicle] / (2 * np.pi)
            np.multiply(matrix, -scale * geometry.tangents[1, vesicle], out=dx[block, block])
            np.multiply(matrix, scale * geometry.tangents[0, vesicle], out=dy[block, block])
            dx[block, count * points + vesicle] = 1.0
            dy[block, count * points + count + vesicle] = 1.0
        return dx, dy

    def _rate_columns(self, geometry: Geometry, ux: Array, uy: Array) -> Array:
        """`rate_of` for velocity components (M·N, columns)."""
        count, points = self.membranes.count, self.membranes.points
        result = np.empty((self.membranes.state_size, ux.shape[1]))
        matrix = differentiation(points)
        for vesicle in range(count):
            block = slice(vesicle * points, (vesicle + 1) * points)
            tx, ty = geometry.tangents[:, vesicle, :, None] * (2 * np.pi / self.membranes.length[vesicle])
            result[block] = tx * (matrix @ uy[block]) - ty * (matrix @ ux[block])
            result[count * points + vesicle] = ux[block].mean(axis=0)
            result[count * points + count + vesicle] = uy[block].mean(axis=0)
        return result
