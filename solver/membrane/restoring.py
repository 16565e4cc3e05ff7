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
from solver.membrane.products import project_out, sum_rows
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
    return bending + adhesion + scene.highest_rate


@compiled
def _solve(products: Array, right: Array, solution: Array) -> None:
    """Write the solution of a symmetric positive system of three equations, by Cramer's rule."""
    a, b, c = products[0, 0], products[0, 1], products[0, 2]
    d, e, f = products[1, 1], products[1, 2], products[2, 2]
    first, second, third = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * first + b * second + c * third
    x, y, z = right[0], right[1], right[2]
    solution[0] = (first * x + second * y + third * z) / determinant
    solution[1] = (second * x + (a * f - c * c) * y + (b * c - a * e) * z) / determinant
    solution[2] = (third * x + (b * c - a * e) * y + (a * d - b * b) * z) / determinant


@compiled
def _gradients(tangents: Array, offsets: Array, held: Array) -> tuple[Array, Array]:
    """Return γ (3, N) of a membrane without the modes that stay as they are, and Γ (3, 3).

    ``tangents`` and ``offsets`` are t and ξ (2, N), ``held`` (N, k) is an orthonormal basis of these modes.
    """
    points = tangents.shape[1]
    gradients, products = np.empty((3, points)), np.empty((3, 3))
    for j in range(points):
        gradients[0, j] = 2 * (tangents[0, j] * offsets[0, j] + tangents[1, j] * offsets[1, j])
        gradients[1, j] = -tangents[1, j]
        gradients[2, j] = tangents[0, j]
    for row in range(3):
        project_out(held, gradients[row])
    for row in range(3):
        for column in range(3):
            total = 0.0
            for j in range(points):
                total += gradients[row, j] * gradients[column, j]
            products[row, column] = total / points
    products[0, 0] += _CIRCLE
    return gradients, products


@compiled
def _deviations(tangents: Array, offsets: Array, reduced_area: float) -> Array:
    """Return g (3,) of a membrane."""
    points = tangents.shape[1]
    area = mean_x = mean_y = 0.0
    for j in range(points):
        area += offsets[0, j] * tangents[1, j] - offsets[1, j] * tangents[0, j]
        mean_x += tangents[0, j]
        mean_y += tangents[1, j]
    deviations = np.empty(3)
    deviations[0], deviations[1], deviations[2] = (
        area / points - reduced_area,
        mean_x / points,
        mean_y / points,
    )
    return deviations


@compiled
def _membrane(
    tangents: Array, points: Array, centers: Array, wavenumber: Array, vesicle: int
) -> tuple[Array, Array]:
    """Return the tangents of one membrane, and its points about its center in units of length/2π."""
    own, about = np.empty((2, tangents.shape[2])), np.empty((2, tangents.shape[2]))
    for component in range(2):
        for j in range(own.shape[1]):
            own[component, j] = tangents[component, vesicle, j]
            offset = points[component, vesicle, j] - centers[component, vesicle]
            about[component, j] = offset * wavenumber[vesicle, 0]
    return own, about


@compiled
def _write_rate(
    tangents: Array,
    points: Array,
    centers: Array,
    wavenumber: Array,
    reduced_area: Array,
    strength: Array,
    held: Array,
    rate: Array,
) -> None:
    """Write the term for all membranes, (M, N)."""
    multipliers = np.empty(3)
    for vesicle in range(rate.shape[0]):
        own, about = _membrane(tangents, points, centers, wavenumber, vesicle)
        gradients, products = _gradients(own, about, held)
        _solve(products, _deviations(own, about, reduced_area[vesicle]), multipliers)
        for j in range(own.shape[1]):
            total = 0.0
            for row in range(3):
                total += multipliers[row] * gradients[row, j]
            rate[vesicle, j] = -strength[vesicle] * total


@compiled
def _write_jacobian(
    tangents: Array,
    offsets: Array,
    reduced_area: float,
    strength: float,
    integration: Array,
    held: Array,
    jacobian: Array,
) -> None:
    """Write the derivative (N, N) of the term of one membrane by its tangent angles."""
    points = tangents.shape[1]
    cosine, sine = tangents[0], tangents[1]
    gradients, products = _gradients(tangents, offsets, held)
    multipliers = np.empty(3)
    _solve(products, _deviations(tangents, offsets, reduced_area), multipliers)
    # Second derivatives of the area, and the diagonal of the others.
    of_area = jacobian
    for i in range(points):
        row, of_row = of_area[i], integration[i]
        for j in range(points):
            row[j] = 2 * of_row[j] * (sine[i] * cosine[j] - cosine[i] * sine[j])
        row[i] += 2 * (cosine[i] * offsets[1, i] - sine[i] * offsets[0, i])
    by_area = np.empty((3, points))
    for k in range(3):
        sum_rows(gradients[k], of_area, by_area[k])
    solutions, by_angle = np.empty((points, 3)), np.empty(3)
    diagonal = np.empty(points)
    for j in range(points):
        combined = along_area = 0.0
        for k in range(3):
            combined += multipliers[k] * gradients[k, j]
            along_area += multipliers[k] * by_area[k, j]
        diagonal[j] = multipliers[1] * cosine[j] + multipliers[2] * sine[j]
        by_angle[0] = 2 * (cosine[j] * offsets[0, j] + sine[j] * offsets[1, j]) - along_area
        by_angle[1] = combined * cosine[j] - sine[j]
        by_angle[2] = combined * sine[j] + cosine[j]
        for k in range(3):
            by_angle[k] -= multipliers[0] * by_area[k, j] - gradients[k, j] * diagonal[j]
            by_angle[k] /= points
        _solve(products, by_angle, solutions[j])
    for i in range(points):
        row = jacobian[i]
        for j in range(points):
            row[j] *= multipliers[0]
        row[i] -= diagonal[i]
        for k in range(3):
            for j in range(points):
                row[j] += gradients[k, i] * solutions[j, k]
    for k in range(held.shape[1]):
        share = by_area[0]
        sum_rows(held[:, k], jacobian, share)
        for i in range(points):
            for j in range(points):
                jacobian[i, j] -= held[i, k] * share[j]
    for i in range(points):
        for j in range(points):
            jacobian[i, j] *= -strength


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
        rate = np.empty_like(geometry.tangent_angle)
        _write_rate(
            geometry.tangents,
            geometry.points,
            geometry.centers,
            geometry.membranes.wavenumber,
            self.reduced_area,
            self.strength,
            highest_modes(geometry.membranes.points),
            rate,
        )
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
        change = np.empty((points, points))
        _write_jacobian(
            *_membrane(
                geometry.tangents,
                geometry.points,
                geometry.centers,
                geometry.membranes.wavenumber,
                vesicle,
            ),
            float(self.reduced_area[vesicle]),
            float(self.strength[vesicle]),
            integration(points),
            highest_modes(points),
            change,
        )
        return change
