"""Integrals over ellipses by brute force, sharing nothing with the solver: the tests' references.

Ellipses are parametrized by the angle α of (a cos α, b sin α), not by arclength, and integrated by
Gauss–Legendre panels that shrink geometrically toward the point nearest to the target.  That resolves the
logarithm at the target itself, and a target at any small distance, to round-off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ellipe

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Ellipse:
    """An ellipse, its long semi-axis ``major`` turned by ``angle`` against x."""

    major: float
    minor: float
    center: complex = 0.0
    angle: float = 0.0

    @classmethod
    def of(cls, reduced_area: float, length: float, center: complex = 0.0, angle: float = 0.0) -> Ellipse:
        """The ellipse of this reduced area 4π·area/length² and perimeter."""

        def excess(aspect: float) -> float:
            perimeter = 4 * ellipe(1 - aspect**2)  # of semi-axes 1 and aspect
            return float(4 * np.pi * np.pi * aspect / perimeter**2 - reduced_area)

        aspect = brentq(excess, 1e-6, 1.0, xtol=1e-16) if reduced_area < 1 else 1.0
        major = length / (4 * ellipe(1 - aspect**2))
        return cls(major, major * aspect, center, angle)

    def points(self, alpha: Array) -> Array:
        """Points, (2, n)."""
        z = self.center + np.exp(1j * self.angle) * (
            self.major * np.cos(alpha) + 1j * self.minor * np.sin(alpha)
        )
        return np.stack([z.real, z.imag])

    def speed(self, alpha: Array) -> Array:
        """ds/dα, (n,)."""
        return np.hypot(self.major * np.sin(alpha), self.minor * np.cos(alpha))

    def parameters(self, tangent_angle: Array) -> Array:
        """The α at which the ellipse has these tangent angles."""
        turned = tangent_angle - self.angle
        return np.arctan2(-np.cos(turned) / self.major, np.sin(turned) / self.minor)


def graded_nodes(at: float, smallest: float = 1e-16, order: int = 24) -> tuple[Array, Array]:
    """Nodes and weights on (at − π, at + π), graded toward ``at``."""
    edges = np.pi * 0.5 ** np.arange(int(np.log2(np.pi / smallest)) + 1)
    edges = np.append(edges, 0.0)
    x, w = np.polynomial.legendre.leggauss(order)
    half = (edges[:-1] - edges[1:]) / 2
    distance = ((edges[:-1] + edges[1:]) / 2)[:, None] + half[:, None] * x
    weight = half[:, None] * w
    return np.append(at - distance, at + distance), np.append(weight, weight)


def nearest_parameter(ellipse: Ellipse, target: Array) -> float:
    """The α of the ellipse's point nearest to ``target`` (2,)."""
    low, high = 0.0, 2 * np.pi
    for _ in range(6):
        alpha = np.linspace(low, high, 401)
        best = alpha[np.argmin(np.hypot(*(ellipse.points(alpha) - target[:, None])))]
        width = (high - low) / 100
        low, high = best - width, best + width
    return float(best)


def integrate(
    ellipse: Ellipse, integrand: Callable[[Array, Array], Array], target: Array, nearest: float
) -> Array:
    """∫ integrand(target − y, α) ds_y over the ellipse, of an integrand of shape (..., n)."""
    alpha, weight = graded_nodes(nearest)
    offset = target[:, None] - ellipse.points(alpha)
    return np.asarray(integrand(offset, alpha) @ (weight * ellipse.speed(alpha)))


def stokes_velocity(
    ellipse: Ellipse, density: Callable[[Array], Array], target: Array, nearest: float
) -> Array:
    """1/(4π) ∫ (−log r I + r⊗r/r²) f ds for a density (2, n) given over α."""

    def integrand(offset: Array, alpha: Array) -> Array:
        f = density(alpha)
        # The innermost panels are shorter than round-off and contribute less than it.
        r2 = np.maximum(np.sum(offset**2, axis=0), 1e-34)
        return (-0.5 * np.log(r2) * f + offset * np.sum(offset * f, axis=0) / r2) / (4 * np.pi)

    return integrate(ellipse, integrand, target, nearest)
