"""A repulsive and an attractive power of the distance."""

from __future__ import annotations

import math
from typing import Literal, Self

from pydantic import model_validator

from solver.pair_potentials.pair_potential import Derivatives, Formula, PairPotential

_LARGEST = 127  # exponent of which the formulas below take all binary digits


class PowerLaw(PairPotential):
    """φ = H[(δ/r)^m − (m/n)(δ/r)^n] (Quaife et al. 2019, eq. 2).

    The force is −∇φ.  The printed one (eq. 3) has the opposite sign.

    Attributes
    ----------
    exponents : (int, int)
        Exponents m and n of repulsion and attraction, m > n ≥ 2.
    """

    kind: Literal["power-law"] = "power-law"
    exponents: tuple[int, int] = (4, 2)

    @property
    def formula(self) -> Formula:
        """A formula without square roots, if the exponents allow."""
        m, n = self.exponents
        return even_power_law if m % 2 == n % 2 == 0 else power_law

    @property
    def parameters(self) -> tuple[float, int, int]:
        """δ, m and n."""
        return (self.distance, *self.exponents)

    @property
    def singularity(self) -> float:
        """That of (x − y)/r^(m + 2)."""
        return 0.5 * self.exponents[0] + 1

    @model_validator(mode="after")
    def _ordered_exponents(self) -> Self:
        m, n = self.exponents
        if not m > n >= 2:
            raise ValueError(f"exponents must be integers m > n >= 2, got [{m}, {n}]")
        if m > _LARGEST:
            raise ValueError(f"exponents must be at most {_LARGEST}, got [{m}, {n}]")
        return self


def even_power_law(square: float, parameters: tuple[float, int, int]) -> Derivatives:
    """Compute φ/H and its derivatives by q = r² for even exponents.

    The exponents are known only at run time.  A power is the product of the repeated squares that its
    exponent's binary digits select, so that there is no loop whose length depends on them.

    Parameters
    ----------
    square : float
        q, length².
    parameters : (float, int, int)
        δ, m and n.

    Returns
    -------
    tuple of three floats
    """
    distance, m, n = parameters
    inverse = 1.0 / square
    power = distance * distance * inverse
    repulsion = attraction = 1.0
    for digit in range(1, 7):
        repulsion *= power if m >> digit & 1 else 1.0
        attraction *= power if n >> digit & 1 else 1.0
        power *= power
    return (
        repulsion - m / n * attraction,
        -0.5 * m * inverse * (repulsion - attraction),
        0.5 * m * inverse * inverse * ((0.5 * m + 1.0) * repulsion - (0.5 * n + 1.0) * attraction),
    )


def power_law(square: float, parameters: tuple[float, int, int]) -> Derivatives:
    """Compute φ/H and its derivatives by q = r² for any exponents; see `even_power_law`.

    Parameters
    ----------
    square : float
        q, length².
    parameters : (float, int, int)
        δ, m and n.

    Returns
    -------
    tuple of three floats
    """
    distance, m, n = parameters
    inverse = 1.0 / square
    power = distance * math.sqrt(inverse)
    repulsion = attraction = 1.0
    for digit in range(7):
        repulsion *= power if m >> digit & 1 else 1.0
        attraction *= power if n >> digit & 1 else 1.0
        power *= power
    return (
        repulsion - m / n * attraction,
        -0.5 * m * inverse * (repulsion - attraction),
        0.5 * m * inverse * inverse * ((0.5 * m + 1.0) * repulsion - (0.5 * n + 1.0) * attraction),
    )
