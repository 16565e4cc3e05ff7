"""The single-layer potential of Stokes flow over all membranes (paper, appendix A):

S f(x) = 1/(4π) ∫ (−log r I + r⊗r/r²) f ds,  r = x − y  (viscosity 1).

On its own vesicle the logarithm is split after Kress, ½ log(4 sin²) being integrated exactly; on another
vesicle the trapezoid rule is used, on refined sources where the target is close (`proximity`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver import kernels
from solver.geometry import Geometry, Membranes
from solver.proximity import Closeness
from solver.quadrature import required_ratio
from solver.refinement import refine_single_layer
from solver.spectral import logarithm_weights

Array = NDArray[np.float64]


class SingleLayer:
    """Discrete single-layer potential, kept as its three components.

    The components act on point forces, that is force densities times the spacing, and are then symmetric
    up to quadrature error.

    Parameters
    ----------
    membranes : Membranes
    accuracy : float
        Relative error allowed in the velocity that one vesicle causes on another.

    Attributes
    ----------
    xx, xy, yy : (M·N, M·N)
        Filled by `assemble`.
    """

    def __init__(self, membranes: Membranes, accuracy: float) -> None:
        self._ratio = required_ratio(1.0, accuracy)
        points = membranes.points
        size = membranes.count * points
        self.xx, self.xy, self.yy = np.zeros((3, size, size))
        alpha = 2 * np.pi * np.arange(points) / points
        sine = np.sin((alpha[:, None] - alpha) / 2)
        np.fill_diagonal(sine, 0.5)  # makes the logarithm vanish there
        weights = logarithm_weights(points) * points / (2 * np.pi)
        self._regular_part = (0.5 * np.log(4 * sine**2) + weights) / (4 * np.pi)
        # On the diagonal r²/(4 sin²) tends to (length/2π)².
        self._diagonal = (weights[0, 0] - np.log(membranes.length / (2 * np.pi))) / (4 * np.pi)

    def assemble(self, geometry: Geometry, closeness: Closeness | None) -> None:
        """Fill the components for this geometry; ``closeness`` is None for a single vesicle."""
        count, points = geometry.membranes.count, geometry.membranes.points
        all_points = geometry.points.reshape(2, -1)
        components = self.xx, self.xy, self.yy
        kernels.stokeslets(all_points, all_points, *components)
        for vesicle in range(count):
            kernels.complete_self_part(
                self._regular_part,
                self._diagonal[vesicle],
                geometry.tangents[:, vesicle],
                vesicle * points,
                *components,
            )
        if closeness is not None:
            refine_single_layer(geometry.points, closeness.refinement(self._ratio), *components)

    def velocity(self, point_forces: Array) -> Array:
        """Velocity (2, M, N) that point forces (2, M, N) cause at the membranes' points."""
        velocity = np.empty_like(point_forces)
        velocity[0].flat, velocity[1].flat = self.columns(point_forces[0].ravel(), point_forces[1].ravel())
        return velocity

    def columns(self, fx: Array, fy: Array) -> tuple[Array, Array]:
        """Velocity components for several point forces at once, (M·N, ...) each."""
        return self.xx @ fx + self.xy @ fy, self.xy @ fx + self.yy @ fy

    def jacobian(self, geometry: Geometry, point_forces: Array) -> tuple[Array, Array]:
        """Derivatives of `velocity` by the state, (M·N, state_size) each, at fixed point forces (2, M, N).

        Sources that are refined for close targets are differentiated as if they were not.
        """
        size = geometry.membranes.count * geometry.membranes.points
        xx, xy, yx, yy = np.empty((4, size, size))
        forces = point_forces.reshape(2, -1)
        kernels.stokeslet_derivatives(geometry.points.reshape(2, -1), forces, xx, xy, yx, yy)
        by_x, by_y = geometry.by_state(xx, xy), geometry.by_state(yx, yy)
        # On the diagonal r⊗r/r² is t⊗t, which turns with the tangent.
        tangents, normals = geometry.tangents.reshape(2, -1), geometry.normals.reshape(2, -1)
        along, across = np.sum(tangents * forces, axis=0), np.sum(normals * forces, axis=0)
        turned = (normals * along + tangents * across) / (4 * np.pi)
        every_point = np.arange(size)
        by_x[every_point, every_point] += turned[0]
        by_y[every_point, every_point] += turned[1]
        return by_x, by_y
