"""A boundary between outcomes, as a study traces it: one bracket a point."""

from __future__ import annotations

import math
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field

from ensemble.config.dotted_paths import is_array
from ensemble.config.measured import (
    Measured,
    dimension_at,
    document_in_units,
    measured_document,
    measured_values,
)
from ensemble.timestamp import Timestamp
from solver.dimensions import Dimension
from solver.scene import Numerics, Scene, Units

BracketEnd = Annotated[float, Field(ge=0)] | None


def _bracket_mean(fields: dict[str, Any]) -> float | None:
    # Absent when the bracket itself was refused; pydantic then reports the bracket.
    low, high = fields.get("bracket", (None, None))
    return None if low is None or high is None else math.sqrt(low) * math.sqrt(high)


class OutcomeChange(BaseModel):
    """Two values between which the outcome of runs changes.

    Attributes
    ----------
    bracket : (float, float)
        The two values.
    outcomes : (str, str)
        Of their runs.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    bracket: tuple[Annotated[float, Field(ge=0)], Annotated[float, Field(ge=0)]]
    outcomes: tuple[str, str]


class Confirmed(BaseModel):
    """A value whose run was sensitive and has been made again at finer numerics, whose outcome counts.

    Attributes
    ----------
    value : float
        Of the searched parameter.
    outcome : str
        Of the first run.
    finer_outcome : str
        Of the run at finer numerics.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    value: float
    outcome: str
    finer_outcome: str


class Scanned(BaseModel):
    """How far a search has looked beside the brackets that it has found.

    Attributes
    ----------
    values : int
        How many further values were tried.  All of them lie on the sides that the brackets give them.
    looked_at : list of float
        These values, ascending.
    widest_unseen : float
        Largest ratio of two neighbors among all values tried, and the limits.  A window of another outcome
        within the limits would have been seen if the ratio of its ends were larger.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    values: int
    looked_at: list[float]
    widest_unseen: float


class BoundaryPoint(BaseModel):
    """The bracket of the critical value at one value of each swept parameter.

    Attributes
    ----------
    parameters : dict
        Values of the swept parameters by their dotted paths.
    bracket : (float or None, float or None)
        Between which values the critical value lies; None for an end that is unknown.
    critical_value : float or None
        Geometric mean of the bracket's ends; None while one of them is unknown.
    outcomes : (str or None, str or None)
        At the two ends of the bracket; if it is certified, those of the finer runs.
    status : str
        What the search, or the certification, has come to.
    changes : list of OutcomeChange
        All changes of the outcome that the search has found within the limits, ascending: those of the
        bracket and, where there are several, the others.
    incidental_changes : list of OutcomeChange
        Further changes that other runs show, made ahead or for other studies.  Which of those there are
        depends on circumstances such as the number of ranks, so the status does not rest on them.
    scanned : Scanned or None
        How far the search has looked beside them; None until it has, or if it does not.
    confirmed : list of Confirmed
        The ends of brackets whose runs were sensitive, ascending; those of earlier brackets, too, which an
        end has left because its finer run came out otherwise.
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
    changes: list[OutcomeChange] = []
    incidental_changes: list[OutcomeChange] = []
    scanned: Scanned | None = None
    confirmed: list[Confirmed] = []
    certified: bool
    certified_by: Numerics | None = None
    runs: list[str]

    @property
    def other_changes(self) -> list[OutcomeChange]:
        """The changes of the outcome that are not within the bracket, ascending."""
        low, high = self.bracket
        return [
            change
            for change in sorted((*self.changes, *self.incidental_changes), key=lambda each: each.bracket)
            if (low is not None and change.bracket[0] < low)
            or (high is not None and change.bracket[1] > high)
        ]


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
        One for each value of the sweep, or combination of the values of several.
    updated : datetime
        When it was known so far.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    study_key: str
    study: dict[str, Any]
    name: str
    points: list[BoundaryPoint]
    updated: Timestamp

    @property
    def swept(self) -> tuple[str, ...]:
        """Dotted paths of the swept parameters."""
        sweep = self.study["sweep"]
        return tuple(each["parameter"] for each in (sweep if is_array(sweep) else [sweep]))

    @property
    def searched(self) -> str:
        """Dotted path of the parameter whose critical value is searched for."""
        return str(self.study["search"]["parameter"])

    @property
    def scene(self) -> Scene:
        """The scene in which the parameters are varied."""
        return Scene.model_validate(self.study["scene"])

    def place(self, point: BoundaryPoint) -> tuple[float, ...]:
        """Return the values of the swept parameters at a point, in their order.

        Parameters
        ----------
        point : BoundaryPoint

        Returns
        -------
        tuple of float
        """
        return tuple(point.parameters[parameter] for parameter in self.swept)

    def in_units(self, units: Units | None) -> Self:
        """Return the boundary as if its scene had other units, or none.

        Parameters
        ----------
        units : Units or None

        Returns
        -------
        Boundary
        """
        return self.model_copy(update={"study": document_in_units(self.study, units)})

    def measured(self) -> list[dict[str, Measured]]:
        """Return the parameters, critical values and brackets in the units of the scene.

        Returns
        -------
        list of dict of str to Measured
            One for each point, by the names that they have there; without what has no unit.
        """
        scene = self.scene
        if scene.units is None:
            return [{} for _ in self.points]
        searched = dimension_at(scene, self.searched)
        measured = []
        for point in self.points:
            values: dict[str, tuple[Any, Dimension | None]] = {
                name: (value, dimension_at(scene, name)) for name, value in point.parameters.items()
            }
            if point.critical_value is not None:
                values |= {
                    "critical_value": (point.critical_value, searched),
                    "bracket": (point.bracket, searched),
                }
            measured.append(measured_values(values, scene.units))
        return measured

    def point_documents(self) -> list[dict[str, Any]]:
        """Return the points as JSON data, each with its values in the units of the scene, if it has any."""
        return [
            point.model_dump(mode="json") | measured_document(measured)
            for point, measured in zip(self.points, self.measured(), strict=True)
        ]
