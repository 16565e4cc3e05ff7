"""When a run is decided, as a scene describes it."""

from __future__ import annotations

from pydantic import Field

from solver.model import Model, NonNegative, Positive


class Criteria(Model):
    """When a run is decided.  The criteria are part of the answer and are stored with it."""

    # Center distance that counts as separated when passed outward; 1.5 times the first one if that is more.
    separated_distance: Positive = 12.0
    # Of the line of centers that a bound pair has completed, or of its long axis that a tumbling vesicle has.
    revolutions: int = Field(1, ge=1)
    gap_growth: NonNegative = 0.01  # relative growth of the gap's maximum that still counts as none
    steady_rate: Positive = 1e-5  # change of every tangent angle and center below which a state is steady
    steady_time: Positive = 5.0  # for at least this long
    extensions: float = Field(4.0, ge=1)  # an undecided run may go on to this multiple of the horizon
