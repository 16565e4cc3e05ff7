"""Any flow whose velocity gradient is the same everywhere: between extension, shear and rotation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from solver.flows.imposed_flow import Array, ImposedFlow, Symbol
from solver.flows.uniform_gradient import FollowingFlow, UniformGradient


class Linear(UniformGradient):
    """Velocity ε(−x, y) + ω(y, −x) with ε + ω = rate and ε − ω = flow_type·rate.

    With the flow type 1 it is `Extension`, with 0 simple shear at that shear rate along x = y, with -1 a
    clockwise rotation.  Up to a turn and a reflection of the axes every constant gradient of an
    incompressible flow is one of these (Fuller & Leal 1980).

    Attributes
    ----------
    rate : float
        Sum of the rate of strain ε and the angular velocity ω.
    flow_type : float
        Kind of the flow, (ε − ω)/(ε + ω): 1 is extension, 0 simple shear, -1 rotation.
    """

    kind: Literal["linear"] = "linear"
    flow_type: float = Field(0.0, ge=-1, le=1)

    title: ClassVar[str] = "linear flow"
    symbols: ClassVar[Mapping[str, Symbol]] = {
        "rate": Symbol("rate of strain plus rotation", "G", "G"),
        "flow_type": Symbol("flow type", r"\alpha", "α"),
    }

    @property
    def rate_of_strain(self) -> float:
        """The rate ε at which lines along y are stretched, 1/time."""
        return self.rate * (1 + self.flow_type) / 2

    @property
    def angular_velocity(self) -> float:
        """That of the rotation, ω, clockwise, radians/time."""
        return self.rate * (1 - self.flow_type) / 2

    @property
    def unit_gradient(self) -> Array:
        """Strain and rotation together, (2, 2)."""
        strain, rotation = (1 + self.flow_type) / 2, (1 - self.flow_type) / 2
        return np.array([[-strain, rotation], [-rotation, strain]])

    @property
    def rotates(self) -> bool:
        """Whether there is any rotation: a pair that is not slender revolves even if strain prevails."""
        return self.flow_type < 1

    @property
    def strains(self) -> bool:
        """Whether strain prevails: then lines of two directions do not turn."""
        return self.flow_type > 0

    @property
    def comoving(self) -> ImposedFlow | None:
        """The same about the mean of the centers, where strain prevails and carries vesicles away."""
        return _FollowingLinear(rate=self.rate, flow_type=self.flow_type) if self.strains else None

    @property
    def shear_rate(self) -> float:
        """Twice the rate of strain."""
        return 2 * self.rate_of_strain

    def effective_aspect_ratio(self, period: float) -> float | None:
        """Return λ ≥ 1 of the rigid ellipse that turns with a period (Jeffery 1922).

        With B = (λ² − 1)/(λ² + 1) the period is 2π/√(ω² − (εB)²).

        Parameters
        ----------
        period : float
            Duration of a full turn, in units of time.

        Returns
        -------
        float or None
            None if no ellipse turns like that, or all do.
        """
        turning = 2 * np.pi / period
        if not self.rate_of_strain or turning > self.angular_velocity:
            return None
        slenderness = np.sqrt(self.angular_velocity**2 - turning**2) / self.rate_of_strain
        return float(np.sqrt((1 + slenderness) / (1 - slenderness))) if slenderness < 1 else None


class _FollowingLinear(FollowingFlow, Linear):
    """The same flow about the mean of the vesicles' centers."""

    kind: Literal["linear"] = "linear"
