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
    """The bracket of the critical value at one set of parameters.

    `critical_value` is the geometric mean of the bracket's ends, and None while one of them is unknown.
    `outcomes` are those at the two ends of the bracket, `runs` the keys of the runs behind it.
    `certified` says that both ends were run again at finer numerics, `certified_by`, and are on their sides
    there; `outcomes` are then those of the finer runs.
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
    """A study and the points of its boundary as far as they are known at `updated`."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    study_key: str
    study: dict[str, Any]
    name: str
    points: list[BoundaryPoint]
    updated: Timestamp
