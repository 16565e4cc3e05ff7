"""When a run is decided, as a scene describes it."""

from __future__ import annotations

from pydantic import Field

from solver.model import Model, NonNegative, Positive


class Criteria(Model):
    """When a run is decided.  The criteria are part of the answer and are stored with it.

    Attributes
    ----------
    separated_distance : float
        Center distance beyond which a pair that moves apart is separated; 1.5 times the first distance if
        that is more.
    revolutions : int
        Full turns that the line of centers of a bound pair has made, or the long axis of a tumbling vesicle.
    gap_growth : float
        Relative growth of the largest gap, from one half turn to the next, that a bound pair may have.
    steady_rate : float
        A state is steady if no tangent angle and no center changes faster.
    steady_time : float
        For at least this long.
    extensions : float
        Multiple of the horizon up to which an undecided pair runs on, in a flow where it may.
    """

    separated_distance: Positive = 12.0
    revolutions: int = Field(1, ge=1)
    gap_growth: NonNegative = 0.01
    steady_rate: Positive = 1e-5
    steady_time: Positive = 5.0
    extensions: float = Field(4.0, ge=1)
