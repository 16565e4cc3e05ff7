"""Fluids inside the vesicles whose viscosity differs from that outside.

With viscosity 1 outside and λ_k inside vesicle k, the velocity v = u_∞ + S f of equal viscosities becomes, on
vesicle j, by the double-layer potentials of all (Pozrikidis 1992, section 5.3),

    ½(1 + λ_j) u = v + Σ_k (1 − λ_k) D_k u,   K u = v.

The mobility K⁻¹S that takes the place of S is symmetric as S is, by the reciprocal theorem.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from solver.potentials.double_layer import DoubleLayer

if TYPE_CHECKING:
    from solver.membrane.geometry import Geometry, Membranes
    from solver.potentials.proximity import Closeness
    from solver.potentials.single_layer import SingleLayer
    from solver.scene.vesicle import Vesicle

Array = NDArray[np.float64]


class ViscosityContrast:
    """The change that viscosities inside the vesicles make in the velocity that forces and flow cause.

    Parameters
    ----------
    contrast : (M,)
        Viscosities inside, relative to that outside.
    membranes : Membranes
    accuracy : float
        As for `SingleLayer`.

    Attributes
    ----------
    matrix : (2·M·N, 2·M·N)
        The mobility K⁻¹S, from point forces to velocities as the matrix of `SingleLayer`.
    """

    def __init__(self, contrast: Array, membranes: Membranes, accuracy: float) -> None:
        self._double_layer = DoubleLayer(membranes, accuracy)
        points = membranes.points
        self._excess = 1 - contrast
        self._mean = np.tile(np.repeat((1 + contrast) / 2, points), 2)
        self._weights = np.tile(np.repeat(self._excess, points), 2)

    def assemble(self, geometry: Geometry, closeness: Closeness | None, layer: SingleLayer) -> None:
        """Factorize K and fill the matrix.

        Parameters
        ----------
        geometry : Geometry
        closeness : Closeness or None
            None for a single curve.
        layer : SingleLayer
            Assembled for the same geometry.
        """
        self._double_layer.assemble(geometry, closeness, layer.matrix)
        system = self._double_layer.matrix * -self._weights
        system[np.diag_indices_from(system)] += self._mean
        self._factors, self._pivots, _ = lapack.dgetrf(system.T, overwrite_a=1)
        self.matrix = self._solve(layer.matrix)

    def velocity(self, unchanged: Array) -> Array:
        """Return the velocity that takes the place of one at equal viscosities.

        Parameters
        ----------
        unchanged : (2, M, N) or (2, M·N, columns)
            At equal viscosities.

        Returns
        -------
        (2, M, N) or (2, M·N, columns)
        """
        return self._solve(unchanged.reshape(len(self._mean), -1)).reshape(unchanged.shape)

    def jacobian(self, geometry: Geometry, velocity: Array) -> Array:
        """Return the derivatives of Σ (1 − λ) D u by the state at fixed u.

        Parameters
        ----------
        geometry : Geometry
        velocity : (2, M, N)
            The velocity u.

        Returns
        -------
        (2, M·N, state_size)
        """
        return self._double_layer.jacobian(geometry, velocity * self._excess[:, None])

    def stress(self, geometry: Geometry, velocity: Array, gradient: Array) -> float:
        """Return the stress that the contrast adds, ∫ (λ − 1) u · (D + Dᵀ) n ds, n outward.

        The fluid inside has the stress of its own viscosity (Batchelor 1970).  In shear it is
        ∫ (λ − 1)(u_x n_y + u_y n_x) ds.

        Parameters
        ----------
        geometry : Geometry
        velocity : (2, M, N)
        gradient : (2, 2)
            D, the imposed velocity gradient over the shear rate.

        Returns
        -------
        float
            Over all membranes, images included.
        """
        membranes, inward = geometry.membranes, geometry.normals
        along = ((gradient + gradient.T) @ inward.reshape(2, -1)).reshape(inward.shape)
        strain = np.sum(velocity[0] * along[0] + velocity[1] * along[1], axis=1)
        return float(membranes.multiplicity * np.sum(self._excess * strain * membranes.spacing))

    def _solve(self, right: Array) -> Array:
        # The factors are of the transposed matrix: LAPACK counts rows and columns the other way.
        solution, _ = lapack.dgetrs(self._factors, self._pivots, right, trans=1)
        return np.ascontiguousarray(solution)


def contrasts(vesicles: Sequence[Vesicle]) -> Array:
    """Return the viscosity contrasts of vesicles.

    Parameters
    ----------
    vesicles : sequence of Vesicle

    Returns
    -------
    (M,)
    """
    return np.array([vesicle.viscosity_contrast for vesicle in vesicles])
