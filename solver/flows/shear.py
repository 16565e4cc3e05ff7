"""Simple shear."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np

from solver.flows.imposed_flow import Array, Symbol
from solver.flows.uniform_gradient import UniformGradient

_UNIT_GRADIENT = np.array([[0.0, 1.0], [0.0, 0.0]])


class Shear(UniformGradient):
    """Velocity rate·(y, 0) (Quaife et al. 2019, section V)."""

    kind: Literal["shear"] = "shear"

    title: ClassVar[str] = "shear flow"
    symbols: ClassVar[Mapping[str, Symbol]] = {"rate": Symbol("shear rate", r"\dot{\gamma}", "γ̇")}

    @property
    def unit_gradient(self) -> Array:
        """du_x/dy alone, (2, 2)."""
        return _UNIT_GRADIENT

    @property
    def rotates(self) -> bool:
        """True: clockwise."""
        return True

    @property
    def shear_rate(self) -> float:
        """The rate."""
        return self.rate

    def effective_aspect_ratio(self, period: float) -> float | None:
        """Return λ ≥ 1 with period = 2π/rate·(λ + 1/λ) (Quaife et al. 2019, eq. 7; Jeffery 1922).

        Parameters
        ----------
        period : float
            Duration of a full turn, in units of time.

        Returns
        -------
        float or None
            None if a rigid ellipse turns more slowly, whatever its shape.
        """
        half_sum = period * self.rate / (4 * np.pi)
        return float(half_sum + np.sqrt(half_sum**2 - 1)) if half_sum >= 1 else None
