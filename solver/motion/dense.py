"""The equation of motion of few vesicles, with matrices over all points.

The membranes move with the fluid, u = u_∞ + S[f_bending + f_adhesion + f_tension], and do not stretch (Quaife
et al. 2019, appendix A).  Where the fluid inside a vesicle has another viscosity than that outside, both
terms of u are changed (`ViscosityContrast`).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.forces.tension import TensionInverse
from solver.membrane.geometry import Geometry, Membranes
from solver.membrane.products import sum_rows
from solver.membrane.spectral import differentiation, highest_modes, integration
from solver.membrane.tangential_velocity import tangential_speed_by_curvature, tangential_speed_weights
from solver.motion.equation import (
    Motion,
    conserved_quantities,
    flow_rate,
    point_shifts,
    restored_motion,
    saved_motion,
)
from solver.motion.jacobian import DenseJacobian
from solver.potentials.proximity import Closeness

if TYPE_CHECKING:
    from solver.flows import ImposedFlow
    from solver.forces.adhesion import DirectAdhesion
    from solver.forces.bending import Bending
    from solver.forces.tension import Inextensibility
    from solver.membrane.restoring import Restoring
    from solver.memory import Saved
    from solver.potentials.single_layer import SingleLayer
    from solver.potentials.viscosity_contrast import ViscosityContrast

Array = NDArray[np.float64]


def _of_steps() -> deque[tuple[bytes, float, Motion]]:
    """Return what keeps the last evaluations, each by the bytes of its state and the rate of its flow.

    A step asks again for one that an iteration began with before it failed, and for one that it ended with
    before its error was probed.
    """
    return deque(maxlen=3)


@dataclass
class DenseEquation:
    """The equation of motion with its exact Jacobian; see `EquationOfMotion`.

    Attributes
    ----------
    membranes : Membranes
    bending : Bending
    adhesion : DirectAdhesion or None
        None for a scene without, and for a single vesicle.
    flow : ImposedFlow or None
        None in a quiescent fluid.  Its rate may be changed between evaluations.
    inextensibility : Inextensibility
    layer : SingleLayer
    contrast : ViscosityContrast or None
        None if all viscosities are equal.
    restoring : Restoring or None
        None where steps are chosen by the drift of areas.
    evaluations, recordings : int
        See `EquationOfMotion`.
    """

    membranes: Membranes
    bending: Bending
    adhesion: DirectAdhesion | None
    flow: ImposedFlow | None
    inextensibility: Inextensibility
    layer: SingleLayer
    contrast: ViscosityContrast | None = None
    restoring: Restoring | None = None
    evaluations: int = field(default=0, init=False)
    recordings: int = field(default=0, init=False)
    _inverse: TensionInverse | None = field(default=None, init=False)
    _recent: deque[tuple[bytes, float, Motion]] = field(default_factory=_of_steps, init=False)
    _assembled: tuple[Geometry, Closeness | None] | None = field(default=None, init=False)

    @property
    def tension_iterations(self) -> int:
        """Number of iterations of the search for the tension so far."""
        return self.inextensibility.iterations

    def motion(self, state: Array) -> Motion:
        """Compute velocity, tension and forces in a state; see `EquationOfMotion`.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        Motion
        """
        if (known := self._known(state)) is not None:
            return known
        self.recordings += 1
        motion, _ = self._evaluate(state)
        return motion

    def rate(self, state: Array) -> Array:
        """Compute d(state)/dt for a step; see `EquationOfMotion`.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        (state_size,)
        """
        if (known := self._known(state)) is not None:
            return known.rate  # an implicit step begins where it has asked for the Jacobian
        return self._evaluate_for_step(state).rate

    def jacobian(self, state: Array) -> DenseJacobian:
        """Compute the derivative of `rate` by the state, for a step.

        Dropped is only the change of a refined quadrature with the points.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        DenseJacobian
        """
        motion = self._known(state) or self._evaluate_for_step(state)
        geometry = motion.geometry
        adhesion = None
        if self.adhesion and motion.closeness:
            adhesion = self.adhesion.jacobian(geometry, motion.closeness)
        matrix, self._inverse = self.linearize(motion, adhesion)
        return DenseJacobian(matrix)

    def restored_jacobian(self, saved: Saved) -> DenseJacobian:
        """Return a Jacobian that `jacobian` once returned; see `EquationOfMotion`.

        Parameters
        ----------
        saved : dict

        Returns
        -------
        DenseJacobian
        """
        return DenseJacobian(saved["matrix"])

    def saved(self) -> Saved:
        """Return what was kept for the next evaluations; see `EquationOfMotion`.

        Returns
        -------
        dict
        """
        return {
            "evaluations": self.evaluations,
            "recordings": self.recordings,
            "tension_iterations": self.inextensibility.iterations,
            "inverse": tuple(self._inverse) if self._inverse else None,
            "recent": [
                saved_motion(np.frombuffer(state), motion) | {"flow_rate": rate}
                for state, rate, motion in self._recent
            ],
        }

    def restore(self, saved: Saved) -> None:
        """Go on where another equation was; see `EquationOfMotion`.

        Parameters
        ----------
        saved : dict
        """
        self.evaluations, self.recordings = saved["evaluations"], saved["recordings"]
        self.inextensibility.iterations = saved["tension_iterations"]
        self._inverse = TensionInverse(*saved["inverse"]) if saved["inverse"] else None
        several = self.membranes.curves > 1
        self._recent.clear()
        for each in saved["recent"]:
            geometry = Geometry(self.membranes, each["state"])
            motion = restored_motion(each, geometry, Closeness(geometry) if several else None)
            self._recent.append((each["state"].tobytes(), each["flow_rate"], motion))

    def symmetries(self, state: Array) -> Array:
        """Return directions in which every motion may be moved; see `EquationOfMotion`.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        (M, state_size)
        """
        return point_shifts(self.membranes, state)

    def conserved(self, state: Array) -> Array:
        """Return quantities of order 1 that the exact motion keeps; see `EquationOfMotion`.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        (3·M,)
        """
        return conserved_quantities(Geometry(self.membranes, state))

    def linearize(self, motion: Motion, adhesion: Array | None) -> tuple[Array, TensionInverse]:
        """Compute the derivative of `Motion.rate` by the state.

        Parameters
        ----------
        motion : Motion
            In that state.
        adhesion : (2, M·N, state_size) or None
            Derivative of its force per length by the state; None if there is no adhesion.

        Returns
        -------
        (state_size, state_size)
        TensionInverse
            In this geometry.
        """
        geometry = motion.geometry
        self._assemble(geometry)
        force = self.bending.jacobian(geometry)
        # The tension's force changes when the membrane rotates, by ∂/∂s (σ n δθ).
        scaled = motion.tension * self.membranes.wavenumber
        geometry.add_rotation(differentiation(self.membranes.points), scaled, force)
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
        stretching, turning = geometry.deformation(velocity)
        size, columns = stretching.shape
        stretching.ravel()[: size * columns : columns + 1] += motion.rotation_rate.ravel()
        stretching *= weights
        inverse, effect = self.inextensibility.factorize(self.contrast or self.layer, geometry)
        tension = inverse.matrix @ stretching
        turning += effect.turning @ tension
        drift = self._means(velocity) + self._means(effect.velocity) @ tension
        return np.concatenate([self._angle_rate_columns(motion, turning), drift]), inverse

    def tension_inverse(self, geometry: Geometry) -> TensionInverse:
        """Compute the inverse that preconditions the search for the tension.

        Parameters
        ----------
        geometry : Geometry

        Returns
        -------
        TensionInverse
            In this geometry.
        """
        self._assemble(geometry)
        inverse, _ = self.inextensibility.factorize(self.contrast or self.layer, geometry)
        return inverse

    def point_derivatives(self, geometry: Geometry) -> Array:
        """Compute the derivatives of the points by the state.

        Parameters
        ----------
        geometry : Geometry

        Returns
        -------
        (2, M·N, state_size)
        """
        count, size = self.membranes.count, self.membranes.count * self.membranes.points
        by_state = np.zeros((2, size, self.membranes.state_size))
        scale = np.full(geometry.tangent_angle.shape, 1 / self.membranes.wavenumber)
        geometry.add_rotation(integration(self.membranes.points), scale, by_state)
        by_vesicle = by_state.reshape(2, count, -1, self.membranes.state_size)
        for vesicle in range(count):
            by_vesicle[0, vesicle, :, size + vesicle] = 1.0
            by_vesicle[1, vesicle, :, size + count + vesicle] = 1.0
        return by_state

    def _evaluate_for_step(self, state: Array) -> Motion:
        """Compute the motion in a state, and keep what helps with the next ones."""
        self.evaluations += 1
        state = state.copy()  # the integrator may go on in its own array, and the motion is kept
        motion, self._inverse = self._evaluate(state)
        self._recent.append((state.tobytes(), flow_rate(self.flow), motion))
        return motion

    def _evaluate(self, state: Array) -> tuple[Motion, TensionInverse]:
        """Compute the motion in a state, and the inverse that served to find its tension."""
        geometry = Geometry(self.membranes, state)
        closeness = self._assemble(geometry)
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
        mobility = self.contrast or self.layer
        free, inverse = self.inextensibility.solve(mobility, geometry, velocity, self._inverse)
        restoring = self.restoring.rate(geometry) if self.restoring else None
        motion = Motion(
            geometry, closeness, free.velocity, free.rotation_rate, free.tension, bending, adhesion, restoring
        )
        return motion, inverse

    def _known(self, state: Array) -> Motion | None:
        """Return the motion in a state in which steps have evaluated it lately, with the present flow."""
        wanted = state.tobytes()
        for known, rate, motion in self._recent:
            if known == wanted and rate == flow_rate(self.flow):
                return motion
        return None

    def _assemble(self, geometry: Geometry) -> Closeness | None:
        """Fill the matrices for a geometry, unless they are filled for it already."""
        if self._assembled is None or self._assembled[0] is not geometry:
            closeness = Closeness(geometry) if self.membranes.curves > 1 else None
            self._assembled = None
            self.layer.assemble(geometry, closeness)
            if self.contrast:
                self.contrast.assemble(geometry, closeness, self.layer)
            self._assembled = geometry, closeness
        return self._assembled[1]

    def _point_forces(self, motion: Motion) -> Array:
        """Return all forces at the points, (2, M, N)."""
        geometry = motion.geometry
        density = motion.bending + geometry.arclength_derivative(motion.tension * geometry.tangents)
        if motion.adhesion is not None:
            density += motion.adhesion
        return density * self.membranes.spacing[:, None]

    def _flow_jacobian(self, flow: ImposedFlow, geometry: Geometry) -> Array:
        """Return derivatives of the imposed velocity at the points by the state, (2, M·N, state_size)."""
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

    def _means(self, velocity: Array) -> Array:
        """Return the means over each vesicle of velocities (2, M·N, columns), (2·M, columns)."""
        each = velocity.reshape(2 * self.membranes.count, self.membranes.points, -1)
        return np.asarray(np.ones(self.membranes.points) @ each) / self.membranes.points

    def _angle_rate_columns(self, motion: Motion, turning: Array) -> Array:
        """Return the rates of the tangent angles for the derivatives of n · u_s by the state, in place."""
        points = self.membranes.points
        _add_tangential_columns(
            motion.geometry.curvature,
            motion.rotation_rate,
            self.membranes.wavenumber,
            differentiation(points),
            highest_modes(points),
            turning,
        )
        if self.restoring:
            for vesicle in range(self.membranes.count):
                block = slice(vesicle * points, (vesicle + 1) * points)
                turning[block, block] += self.restoring.jacobian(motion.geometry, vesicle)
        return turning


@compiled
def _add_tangential_columns(
    curvature: Array,
    rotation_rate: Array,
    wavenumber: Array,
    differentiation: Array,
    held: Array,
    columns: Array,
) -> None:
    """Turn derivatives of n · u_s by the state, (M·N, S), into those of `add_tangential_motion`, in place."""
    count, points = curvature.shape
    weights, by_curvature, by_angle = np.empty(points), np.empty(points), np.empty(points)
    total = np.empty(columns.shape[1])
    for vesicle in range(count):
        own = columns[vesicle * points : (vesicle + 1) * points]
        kappa, scale = curvature[vesicle], wavenumber[vesicle, 0]
        tangential_speed_weights(kappa, weights)
        speed = tangential_speed_by_curvature(kappa, rotation_rate[vesicle], by_curvature)
        sum_rows(weights, own, total)
        sum_rows(by_curvature, differentiation, by_angle)
        first = vesicle * points
        for j in range(points):
            total[first + j] += scale * by_angle[j]
        for i in range(points):
            row, along = own[i], kappa[i]
            for j in range(row.size):
                row[j] += along * total[j]
            of_own, derivative = row[first : first + points], differentiation[i]
            for j in range(points):
                of_own[j] += speed * scale * derivative[j]
        for k in range(held.shape[1]):
            sum_rows(held[:, k], own, total)
            for i in range(points):
                row, along = own[i], held[i, k]
                for j in range(row.size):
                    row[j] -= along * total[j]
