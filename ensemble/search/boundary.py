"""A boundary between outcomes, as a study traces it: one bracket a point."""

from __future__ import annotations

import math
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from ensemble.timestamp import Timestamp
from solver.scene import Numerics

BracketEnd = Annotated[float, Field(ge=0)] | None


def _bracket_mean(fields: dict[str, Any]) -> float | None:
    # Absent when the bracket itself was refused; pydantic then reports the bracket.
    low, high = fields.get("bracket", (None, None))
    return None if low is None or high is None else math.sqrt(low) * math.sqrt(high)


class BoundaryPoint(BaseModel):
    """The bracket of the critical value at one value of the swept parameter.

    Attributes
    ----------
    parameters : dict
        The swept parameter by its dotted path.
    bracket : (float or None, float or None)
        Between which values the critical value lies; None for an end that is unknown.
    critical_value : float or None
        Geometric mean of the bracket's ends; None while one of them is unknown.
    outcomes : (str or None, str or None)
        At the two ends of the bracket; if it is certified, those of the finer runs.
    status : str
        What the search, or the certification, has come to.
    certified : bool
        Whether both ends were run again at finer numerics and came out on the same sides.
    certified_by : Numerics or None
        The finer numerics.
    runs : list of str
        Keys of the runs behind the point.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    parameters: dict[str, float]
    bracket: tuple[BracketEnd, BracketEnd]
    critical_value: float | None = Field(default_factory=_bracket_mean)
    outcomes: tuple[str | None, str | None]
    status: str
    certified: bool
    certified_by: Numerics | None = None
    runs: list[str]


class Boundary(BaseModel):
    """The boundary of a study, as far as it is known.

    Attributes
    ----------
    study_key : str
        Key of the study.
    study : dict
        The study in full.
    name : str
        Of the study.
    points : list of BoundaryPoint
        One for each value of the sweep.
    updated : datetime
        When it was known so far.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    study_key: str
    study: dict[str, Any]
    name: str
    points: list[BoundaryPoint]
    updated: Timestamp
