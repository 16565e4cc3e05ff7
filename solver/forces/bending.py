"""Bending of a membrane with the Helfrich energy ½κ∫curvature² ds: f = −κ x_ssss (paper, section II)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.membrane.geometry import Geometry
from solver.membrane.spectral import differentiation

Array = NDArray[np.float64]


class Bending:
    """Bending of all membranes; a `Force`."""

    def density(self, geometry: Geometry) -> Array:
        """Force per length, (2, M, N)."""
        density = geometry.arclength_derivative(geometry.tangents, order=3)
        density *= -geometry.membranes.bending_modulus[:, None]
        return density

    def jacobian(self, geometry: Geometry) -> Array:
        """Derivative of `density` by the state, (2, M·N, state).

        x_s = (cos θ, sin θ), so x_ssss depends on the tangent angles directly, without the points.
        """
        membranes = geometry.membranes
        points = membranes.points
        third = differentiation(points, 3)
        jacobian = np.zeros((2, membranes.count * points, membranes.state_size))
        for vesicle in range(membranes.count):
            block = slice(vesicle * points, (vesicle + 1) * points)
            scale = -membranes.bending_modulus[vesicle] * (2 * np.pi / membranes.length[vesicle]) ** 3
            np.multiply(third, -scale * geometry.tangents[1, vesicle], out=jacobian[0, block, block])
            np.multiply(third, scale * geometry.tangents[0, vesicle], out=jacobian[1, block, block])
        return jacobian

    def energy(self, geometry: Geometry) -> float:
        """½κ∫curvature² ds over all membranes."""
        curvature_vector = geometry.arclength_derivative(geometry.tangents)
        square = np.sum(curvature_vector**2, axis=(0, 2)) * geometry.membranes.spacing
        return float(0.5 * geometry.membranes.copies * np.sum(geometry.membranes.bending_modulus * square))
