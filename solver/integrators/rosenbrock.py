"""Rosenbrock–Wanner methods: linearly implicit Runge–Kutta formulas with the exact Jacobian.

Hairer & Wanner, Solving Ordinary Differential Equations II, section IV.7.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.integrators.control import Attempt
from solver.integrators.one_step import Linearization

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Tableau:
    """Coefficients, in the form that needs no product with the Jacobian.

    With step size h, Jacobian J and increments kᵢ of the stages,

        (I − γ h J) kᵢ = γ h f(y₀ + Σⱼ aᵢⱼ kⱼ) + γ Σⱼ cᵢⱼ kⱼ,    y₁ = y₀ + Σⱼ aₛⱼ kⱼ + kₛ,

    where the last kₛ is the embedded estimate of the error of y₁, and within the step, at the fraction τ,

        y(τ) = (1 − τ) y₀ + τ (y₁ + (1 − τ) (d₁ + τ d₂ + τ² d₃ + …)),    dₘ = Σⱼ dₘⱼ kⱼ.

    order : of y₁; that of the estimate is the same, one more than of what it estimates
    diagonal : γ
    stage : a, strictly lower triangular, (stages, stages)
    coupling : c, the same
    dense : d, (·, stages)
    """

    order: int
    diagonal: float
    stage: Array
    coupling: Array
    dense: Array


class Rosenbrock:
    """A stiffly accurate Rosenbrock–Wanner method."""

    def __init__(self, tableau: Tableau) -> None:
        self._tableau = tableau

    def attempt(self, near: Linearization, size: float) -> Attempt:
        """See `OneStepMethod`."""
        tableau = self._tableau
        solve = near.solver(tableau.diagonal * size)
        increments = np.empty((len(tableau.stage), len(near.state)))
        value, slope = near.state, near.slope
        for stage in range(len(increments)):
            found = increments[:stage]
            if stage > 0:
                value = near.state + tableau.stage[stage, :stage] @ found
                slope = near.rate(value)
            right = size * slope + tableau.coupling[stage, :stage] @ found
            increments[stage] = solve(tableau.diagonal * right)
        after = value + increments[-1]
        bends = tableau.dense @ increments

        def interpolate(fraction: float) -> Array:
            bend = np.polynomial.polynomial.polyval(fraction, bends)
            inner = (1 - fraction) * near.state + fraction * (after + (1 - fraction) * bend)
            return np.asarray(inner)

        return Attempt(
            size=size, before=near.state, after=after, estimate=increments[-1], interpolate=interpolate
        )
