"""A rate that oscillates."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from solver.dimensions import ANGLE, TIME
from solver.model import Positive
from solver.protocols.rate_protocol import Piece, RateProtocol


class Sine(RateProtocol):
    """The rate is that of the flow times mean + amplitude·sin(2π·time/period + phase), for ever.

    It may change its sign: then the flow is reversed.

    Attributes
    ----------
    mean, amplitude : float
        Mean and amplitude of the rate, as multiples of the flow's rate.
    period : float
        Time of one oscillation.
    phase : float
        Phase at time 0, in radians.
    """

    kind: Literal["sine"] = "sine"
    mean: float = 0.0
    amplitude: Positive = 1.0
    period: Annotated[Positive, TIME]
    phase: Annotated[float, ANGLE] = 0.0

    title: ClassVar[str] = "with an oscillating rate"
    time_scale: ClassVar[str] = "period"

    @property
    def pieces(self) -> tuple[Piece, ...]:
        """A single one."""
        mean, amplitude, phase, frequency = self.mean, self.amplitude, self.phase, 2 * math.pi / self.period
        return (
            Piece(
                0.0,
                lambda time: mean + amplitude * math.sin(frequency * time + phase),
                lambda time: amplitude * frequency * math.cos(frequency * time + phase),
                lambda time: (
                    mean * time
                    + amplitude / frequency * (math.cos(phase) - math.cos(frequency * time + phase))
                ),
            ),
        )

    def largest(self, horizon: float) -> float:
        """Return mean and amplitude together; see `RateProtocol`.

        Parameters
        ----------
        horizon : float

        Returns
        -------
        float
        """
        return abs(self.mean) + self.amplitude
