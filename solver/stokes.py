"""The single-layer potential of Stokes flow over all membranes (paper, appendix A):

S f(x) = 1/(4π) ∫ (−log r I + r⊗r/r²) f ds,  r = x − y  (viscosity 1).

On its own vesicle the logarithm is split after Kress, ½ log(4 sin²) being integrated exactly; on another
vesicle the trapezoid rule is used, on refined sources where the target is close (`refinement`), and Cauchy
sums where it is very close (`close_evaluation`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver import kernels
from solver.close_evaluation import close_single_layer, logarithm_correction
from solver.geometry import Geometry, Membranes
from solver.proximity import Closeness
from solver.quadrature import required_ratio
from solver.refinement import LARGEST_REFINED, refine_single_layer
from solver.spectral import differentiation

Array = NDArray[np.float64]


class SingleLayer:
    """Discrete single-layer potential, kept as its three components.

    The components act on point forces, that is force densities times the spacing, and are then symmetric
    up to quadrature error.  Images (`symmetry`) carry the opposite forces.

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
        self._of_curves = np.zeros((3, membranes.count * points, membranes.curves * points))
        self.xx, self.xy, self.yy = self._of_curves
        self._correction = logarithm_correction(points)
        self._diagonal = self._correction[0, 0] - np.log(membranes.length / (2 * np.pi)) / (4 * np.pi)

    def assemble(self, geometry: Geometry, closeness: Closeness | None) -> None:
        """Fill the components for this geometry; ``closeness`` is None for a single vesicle."""
        membranes = geometry.membranes
        points = membranes.points
        components = tuple(self._of_curves)
        kernels.stokeslets(
            geometry.points.reshape(2, -1), geometry.curve_points.reshape(2, -1), *components
        )
        for vesicle in range(membranes.count):
            kernels.complete_self_part(
                self._correction,
                self._diagonal[vesicle],
                geometry.tangents[:, vesicle],
                vesicle * points,
                *components,
            )
        if closeness is None:
            return
        refinement = closeness.refinement(self._ratio)
        refine_single_layer(geometry.curve_points, refinement, *components)
        if refinement.groups[:, 2].max() > LARGEST_REFINED:
            close_single_layer(
                geometry.curve_points,
                geometry.curve_tangents,
                membranes.curve_spacing,
                refinement,
                self._correction,
                differentiation(points),
                *components,
            )
        self.xx, self.xy, self.yy = membranes.fold(self._of_curves)

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
        membranes = geometry.membranes
        size = membranes.count * membranes.points
        derivatives = np.empty((4, size, membranes.copies * size))
        curve_forces = membranes.with_images(point_forces, axis=1).reshape(2, -1)
        kernels.stokeslet_derivatives(geometry.curve_points.reshape(2, -1), curve_forces, *derivatives)
        xx, xy, yx, yy = membranes.fold(derivatives)
        by_x, by_y = geometry.by_state(xx, xy), geometry.by_state(yx, yy)
        forces = point_forces.reshape(2, -1)
        # On the diagonal r⊗r/r² is t⊗t, which turns with the tangent.
        tangents, normals = geometry.tangents.reshape(2, -1), geometry.normals.reshape(2, -1)
        along, across = np.sum(tangents * forces, axis=0), np.sum(normals * forces, axis=0)
        turned = (normals * along + tangents * across) / (4 * np.pi)
        every_point = np.arange(size)
        by_x[every_point, every_point] += turned[0]
        by_y[every_point, every_point] += turned[1]
        return by_x, by_y
