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
        Center distance beyond which a pair that moves apart is separated; 1.5 times the first distance if
        that is more.
    revolutions : int
        Full turns that the line of centers of a bound pair has made at least, or the long axis of a tumbling
        vesicle.
    settled_change : float
        A motion that revolves has settled if durations of its half turns, and largest center distances in
        them, change relatively by no more, from one to the next or from every other one to the next, and by
        no more in all that follow.
    steady_rate : float
        A state is steady if no tangent angle and no center changes faster.
    steady_time : float
        For at least this long.
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
