"""When a run is decided, as a scene describes it."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, ValidationInfo, model_validator

from solver.dimensions import LENGTH, RATE, TIME
from solver.model import Model, Positive

_FORMER = ("gap_growth", "extensions")


class Criteria(Model):
    """When a run is decided.  The criteria are part of the answer and are stored with it.

    Attributes
    ----------
    separated_distance : float
        Distance of the centers beyond which a pair that moves apart counts as separated; at least 1.5 times
        the distance at the start.
    revolutions : int
        Full turns that a pair must make to count as bound, or a vesicle to count as tumbling.
    settled_change : float
        Largest relative change, from one half turn to the next or to the next but one, of its duration and of
        the largest center distance in it, at which a turning motion counts as settled.
    steady_rate : float
        Largest rate of change of tangent angles and centers at which a state counts as steady.
    steady_time : float
        Time for which a state must remain so to count as steady.
    """

    separated_distance: Annotated[Positive, LENGTH] = 12.0
    revolutions: int = Field(1, ge=1)
    settled_change: Positive = 0.01
    steady_rate: Annotated[Positive, RATE] = 1e-5
    steady_time: Annotated[Positive, TIME] = 5.0

    @model_validator(mode="before")
    @classmethod
    def _without_former_fields(cls, fields: Any, info: ValidationInfo) -> Any:
        """Leave out what runs stored by earlier versions have.

        A document that is given now has a context.  There such a field is refused: without it the run would
        be another one.
        """
        if not isinstance(fields, dict):
            return fields
        if info.context is not None and "extensions" in fields:
            raise ValueError(
                "extensions is gone: horizon is the latest time of a run, so multiply it instead"
            )
        return {name: value for name, value in fields.items() if name not in _FORMER}
