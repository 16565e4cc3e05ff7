"""Bending of a membrane with the Helfrich energy ½κ∫curvature² ds: f = −κ x_ssss.

(Quaife et al. 2019, section II.)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.membrane.spectral import differentiation

if TYPE_CHECKING:
    from solver.membrane.geometry import Geometry, Membranes

Array = NDArray[np.float64]

# Tension of a circle, in modulus/radius²: under a strain of rate ½ it departs from its shape by 1e-6.
_CIRCLE_TENSION = 1e6


class Bending:
    """Bending of all membranes."""

    def density(self, geometry: Geometry) -> Array:
        """Compute the force per length, −κ x_ssss.

        Parameters
        ----------
        geometry : Geometry

        Returns
        -------
        (2, M, N)
        """
        density = geometry.arclength_derivative(geometry.tangents, order=3)
        density *= -geometry.membranes.bending_modulus[:, None]
        return density

    def jacobian(self, geometry: Geometry) -> Array:
        """Differentiate `density` by the state.

        x_s = (cos θ, sin θ), so x_ssss depends on the tangent angles directly, without the points.

        Parameters
        ----------
        geometry : Geometry

        Returns
        -------
        (2, M·N, state_size)
        """
        membranes = geometry.membranes
        jacobian = np.zeros((2, membranes.count * membranes.points, membranes.state_size))
        by_vesicle = -membranes.bending_modulus[:, None] * membranes.wavenumber**3
        scale = np.full(geometry.tangent_angle.shape, by_vesicle)
        geometry.add_rotation(differentiation(membranes.points, 3), scale, jacobian)
        return jacobian

    def energy(self, geometry: Geometry) -> float:
        """Compute ½κ∫curvature² ds over all membranes, images included.

        Parameters
        ----------
        geometry : Geometry

        Returns
        -------
        float
        """
        membranes = geometry.membranes
        energy = _energy(
            geometry.arclength_derivative(geometry.tangents), membranes.bending_modulus, membranes.spacing
        )
        return membranes.multiplicity * float(energy)


@compiled
def _energy(curvature_vector: Array, bending_modulus: Array, spacing: Array) -> float:
    """Compute ½κ∫curvature² ds over the vesicles from x_ss (2, M, N)."""
    total = 0.0
    for vesicle in range(spacing.size):
        square = 0.0
        for component in range(2):
            own = curvature_vector[component, vesicle]
            for j in range(own.size):
                square += own[j] * own[j]
        total += 0.5 * bending_modulus[vesicle] * spacing[vesicle] * square
    return total


class BendingOfCircles(Bending):
    """Bending, and on circular vesicles the constant tension that keeps them round.

    A circle has the largest area for its length, so an inextensible one moves as a rigid body.  What holds it
    against a strain is a constant tension without bound: it moves the membrane by as much as this is no
    circle.  A large finite one leaves a small departure, in proportion to the strain, and makes the circle a
    stable state, whatever the time step.

    Parameters
    ----------
    membranes : Membranes
    """

    def __init__(self, membranes: Membranes) -> None:
        scale = membranes.bending_modulus * membranes.wavenumber[:, 0] ** 2
        self._tension = np.where(membranes.circular, _CIRCLE_TENSION * scale, 0.0)

    def density(self, geometry: Geometry) -> Array:
        """Compute the force per length, −κ x_ssss + σ x_ss.

        Parameters
        ----------
        geometry : Geometry

        Returns
        -------
        (2, M, N)
        """
        return super().density(geometry) + self._tension[:, None] * geometry.arclength_derivative(
            geometry.tangents
        )

    def jacobian(self, geometry: Geometry) -> Array:
        """Differentiate `density` by the state.

        Parameters
        ----------
        geometry : Geometry

        Returns
        -------
        (2, M·N, state_size)
        """
        jacobian = super().jacobian(geometry)
        points = geometry.membranes.points
        by_vesicle = self._tension[:, None] * geometry.membranes.wavenumber
        pull = np.full(geometry.tangent_angle.shape, by_vesicle)
        geometry.add_rotation(differentiation(points), pull, jacobian)
        return jacobian


def bending_of(membranes: Membranes) -> Bending:
    """Make the bending of these membranes.

    Parameters
    ----------
    membranes : Membranes

    Returns
    -------
    Bending
    """
    return BendingOfCircles(membranes) if membranes.circular.any() else Bending()
