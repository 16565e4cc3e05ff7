"""Rosenbrock–Wanner methods: linearly implicit Runge–Kutta formulas with the exact Jacobian.

See (Hairer & Wanner 1996, section IV.7).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.integrators.control import Attempt

if TYPE_CHECKING:
    from solver.integrators.one_step import Linearization

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Tableau:
    """Coefficients, in the form that needs no product with the Jacobian (Hairer & Wanner 1996, section IV.7).

    With step size h, Jacobian J and increments kᵢ of the stages,

        (I − γ h J) kᵢ = γ h f(y₀ + Σⱼ aᵢⱼ kⱼ) + γ Σⱼ cᵢⱼ kⱼ,    y₁ = y₀ + Σⱼ aₛⱼ kⱼ + kₛ,

    where the last kₛ is the embedded estimate of the error of y₁, and within the step, at the fraction τ,

        y(τ) = (1 − τ) y₀ + τ (y₁ + (1 − τ) (d₁ + τ d₂ + τ² d₃ + …)),    dₘ = Σⱼ dₘⱼ kⱼ.

    Attributes
    ----------
    order : int
        Of y₁.  The estimate grows as this power of the step size.
    diagonal : float
        The coefficient γ.
    stage : (stages, stages)
        The coefficients a, strictly lower triangular.
    coupling : (stages, stages)
        The coefficients c, strictly lower triangular.
    dense : (·, stages)
        The coefficients d.
    """

    order: int
    diagonal: float
    stage: Array
    coupling: Array
    dense: Array


class Rosenbrock:
    """A stiffly accurate Rosenbrock–Wanner method.

    Parameters
    ----------
    tableau : Tableau
    """

    def __init__(self, tableau: Tableau) -> None:
        self._tableau = tableau

    def attempt(self, near: Linearization, size: float) -> Attempt:
        """Try a step, see `OneStepMethod`.

        Parameters
        ----------
        near : Linearization
            Where the step begins.
        size : float
            Its duration.

        Returns
        -------
        Attempt
        """
        tableau = self._tableau
        solve = near.solver(tableau.diagonal * size)
        increments = np.empty((len(tableau.stage), len(near.state)))
        value, slope = near.state, near.slope
        for stage in range(len(increments)):
            earlier = increments[:stage]
            if stage > 0:
                value = near.state + tableau.stage[stage, :stage] @ earlier
                slope = near.rate(value)
            right = size * slope + tableau.coupling[stage, :stage] @ earlier
            increments[stage] = solve(tableau.diagonal * right)
        after = value + increments[-1]
        coefficients = tableau.dense @ increments

        def interpolate(fraction: float) -> Array:
            correction = np.polynomial.polynomial.polyval(fraction, coefficients)
            inner = (1 - fraction) * near.state + fraction * (after + (1 - fraction) * correction)
            return np.asarray(inner)

        return Attempt(
            size=size, before=near.state, after=after, estimate=increments[-1], interpolate=interpolate
        )
