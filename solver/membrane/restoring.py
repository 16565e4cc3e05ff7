"""A term that leads the enclosed area of each membrane, and its closure, back to what they must be.

The exact motion keeps the area, and keeps the curve closed.  The computed one keeps them only as accurately
as its steps, and over a long run the deviations would add up.  Let g be the deviations of one membrane: its
reduced area a = 4π·area/length² less that of the scene, and its mean tangent, which is zero for a closed
curve.  With t the tangents and ξ the points about their mean in units of length/2π, a change δθ of the
tangent angles changes them by ⟨γ δθ⟩, ⟨·⟩ being the mean over the membrane:

    γ = (2 t · ξ, −sin θ, cos θ),    θ_t = … − β γᵀ Γ⁻¹ g,    Γ = ⟨γ γᵀ⟩.

Of all changes of the tangent angles with which g decays like exp(−βt) this is the least one (README, S6a).
It vanishes on the exact motion.  A circle has no gradient of the area: there the term of the area fades.

The strength β is the rate at which forces and flow change shapes.  Measured on doublets and single vesicles,
0.3 to 10 times as much gives the same period in the same number of evaluations, so only its scale matters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.membrane.spectral import highest_modes, integration

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.membrane.geometry import Geometry
    from solver.scene import Scene, Vesicle

Array = NDArray[np.float64]

# Added to ⟨γ²⟩ of the area, which is some 5 times what the reduced area lacks to 1.
_CIRCLE = 1e-6


def shape_rates(vesicles: Sequence[Vesicle], scene: Scene) -> Array:
    """Return how fast bending, adhesion and flow change the shapes of some of a scene's vesicles.

    Parameters
    ----------
    vesicles : sequence of Vesicle
        M of them.
    scene : Scene

    Returns
    -------
    (M,)
        1/time, up to a factor.
    """
    bending = np.array([v.bending_modulus * (2 * np.pi / v.length) ** 3 for v in vesicles])
    adhesion = scene.adhesion.hamaker if scene.adhesion else 0.0
    flow = scene.flow.rate if scene.flow else 0.0
    return bending + adhesion + flow


@compiled
def _solve(matrix: Array, right: Array) -> Array:
    """Return the solution of a symmetric positive system of three equations, by Cramer's rule."""
    a, b, c = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    d, e, f = matrix[1, 1], matrix[1, 2], matrix[2, 2]
    adjugate = np.empty((3, 3))
    adjugate[0, 0], adjugate[0, 1], adjugate[0, 2] = d * f - e * e, c * e - b * f, b * e - c * d
    adjugate[1, 1], adjugate[1, 2], adjugate[2, 2] = a * f - c * c, b * c - a * e, a * d - b * b
    adjugate[1, 0], adjugate[2, 0], adjugate[2, 1] = adjugate[0, 1], adjugate[0, 2], adjugate[1, 2]
    determinant = a * adjugate[0, 0] + b * adjugate[0, 1] + c * adjugate[0, 2]
    return np.dot(adjugate, right) / determinant


@compiled
def _gradients(tangents: Array, offsets: Array, held: Array) -> tuple[Array, Array]:
    """Return γ (3, N) of a membrane without the modes that stay as they are, and Γ (3, 3).

    ``tangents`` and ``offsets`` are t and ξ (2, N), ``held`` (N, k) is an orthonormal basis of these modes.
    """
    points = tangents.shape[1]
    gradients = np.empty((3, points))
    for j in range(points):
        gradients[0, j] = 2 * (tangents[0, j] * offsets[0, j] + tangents[1, j] * offsets[1, j])
        gradients[1, j] = -tangents[1, j]
        gradients[2, j] = tangents[0, j]
    gradients -= np.dot(np.dot(gradients, held), held.T)
    products = np.dot(gradients, gradients.T) / points
    products[0, 0] += _CIRCLE
    return gradients, products


@compiled
def _deviations(tangents: Array, offsets: Array, reduced_area: float) -> Array:
    """Return g (3,) of a membrane."""
    deviations = np.zeros(3)
    for j in range(tangents.shape[1]):
        deviations[0] += offsets[0, j] * tangents[1, j] - offsets[1, j] * tangents[0, j]
        deviations[1] += tangents[0, j]
        deviations[2] += tangents[1, j]
    deviations /= tangents.shape[1]
    deviations[0] -= reduced_area
    return deviations


@compiled
def _rate(tangents: Array, offsets: Array, reduced_area: Array, strength: Array, held: Array) -> Array:
    """Return the term for all membranes, (M, N)."""
    rate = np.empty((tangents.shape[1], tangents.shape[2]))
    for vesicle in range(rate.shape[0]):
        own, about = tangents[:, vesicle].copy(), offsets[:, vesicle].copy()
        gradients, products = _gradients(own, about, held)
        multipliers = _solve(products, _deviations(own, about, reduced_area[vesicle]))
        rate[vesicle] = -strength[vesicle] * np.dot(multipliers, gradients)
    return rate


@dataclass(frozen=True)
class Restoring:
    """Leads areas and closures back.

    Attributes
    ----------
    reduced_area : (M,)
        Those of the scene.
    strength : (M,)
        β, 1/time.
    """

    reduced_area: Array
    strength: Array

    @classmethod
    def of_some(cls, vesicles: Sequence[Vesicle], scene: Scene) -> Self:
        """Make the term for some of a scene's vesicles, with the strength `shape_rates`.

        Parameters
        ----------
        vesicles : sequence of Vesicle
            M of them.
        scene : Scene

        Returns
        -------
        Restoring
        """
        reduced_area = np.array([vesicle.reduced_area for vesicle in vesicles])
        # No change of shape leads the area of a circle back: it is the largest for its length.
        circles = [vesicle.is_circle for vesicle in vesicles]
        return cls(reduced_area, np.where(circles, 0.0, shape_rates(vesicles, scene)))

    def of_vesicle(self, vesicle: int) -> Self:
        """Return the term of one vesicle.

        Parameters
        ----------
        vesicle : int

        Returns
        -------
        Restoring
        """
        part = slice(vesicle, vesicle + 1)
        return replace(self, reduced_area=self.reduced_area[part], strength=self.strength[part])

    def rate(self, geometry: Geometry) -> Array:
        """Compute what is added to the rates of the tangent angles.

        Parameters
        ----------
        geometry : Geometry

        Returns
        -------
        (M, N)
            Without the highest modes, which stay as they are.
        """
        held = highest_modes(geometry.membranes.points)
        rate: Array = _rate(geometry.tangents, _offsets(geometry), self.reduced_area, self.strength, held)
        return rate

    def jacobian(self, geometry: Geometry, vesicle: int) -> Array:
        """Compute the exact derivative of the term of one vesicle by its tangent angles.

        Parameters
        ----------
        geometry : Geometry
        vesicle : int

        Returns
        -------
        (N, N)
        """
        points = geometry.membranes.points
        held = highest_modes(points)
        own = np.ascontiguousarray(geometry.tangents[:, vesicle])
        about = np.ascontiguousarray(_offsets(geometry)[:, vesicle])
        gradients, products = _gradients(own, about, held)
        multipliers = _solve(products, _deviations(own, about, self.reduced_area[vesicle]))
        combined = multipliers @ gradients
        cosine, sine = own
        # Second derivatives of the deviations, each (N, N) or the diagonal of such.
        products_of_tangents = np.outer(2 * sine, cosine)
        of_area = integration(points) * (products_of_tangents - products_of_tangents.T)
        diagonal = slice(None, None, points + 1)
        of_area.flat[diagonal] += 2 * (cosine * about[1] - sine * about[0])
        of_all = multipliers[0] * of_area
        of_all.flat[diagonal] -= multipliers[1] * cosine + multipliers[2] * sine
        by_angle = np.stack([2 * (cosine * about[0] + sine * about[1]), -sine, cosine])
        by_angle -= np.stack([combined @ of_area, -combined * cosine, -combined * sine])
        by_angle -= gradients @ of_all
        change = of_all + gradients.T @ np.linalg.solve(products, by_angle / points)
        change -= held @ (held.T @ change)
        return np.asarray(-self.strength[vesicle] * change)


def _offsets(geometry: Geometry) -> Array:
    """Return the points about the centers in units of length/2π, (2, M, N)."""
    return (geometry.points - geometry.centers[:, :, None]) * geometry.membranes.wavenumber
