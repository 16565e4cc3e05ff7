"""A branch of steady states: how they change with a parameter, and where they become unstable."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import BaseModel, ConfigDict

from ensemble.config.measured import Measured, dimension_at, measured_document, measured_fields
from ensemble.timestamp import Timestamp
from solver.analysis.run import Energy, Outcome, Viscosity
from solver.dimensions import LENGTH, RATE
from solver.revision import RESULTS_REVISION
from solver.scene import Scene, Units

if TYPE_CHECKING:
    from solver.simulation.steady_scenes import SteadyPoint, SteadyState


class SteadyRecord(BaseModel):
    """A steady state without its shapes; see `solver.simulation.steady_scenes.SteadyState`.

    Attributes
    ----------
    stable : bool
    outcome : Outcome
    inclination_angle, gap : float or None
    viscosity : Viscosity or None
    energy : Energy
    spatial_error : float
    eigenvalues : tuple of (float, float)
        Real and imaginary parts.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    stable: bool
    outcome: Outcome
    inclination_angle: float | None
    gap: Annotated[float | None, LENGTH]
    viscosity: Viscosity | None
    energy: Energy
    spatial_error: float
    eigenvalues: tuple[tuple[Annotated[float, RATE], Annotated[float, RATE]], ...]

    @classmethod
    def of(cls, state: SteadyState) -> Self:
        """Record a steady state.

        Parameters
        ----------
        state : SteadyState

        Returns
        -------
        SteadyRecord
        """
        unchanged = {name: getattr(state, name) for name in cls.model_fields if name != "eigenvalues"}
        parts = tuple((float(value.real), float(value.imag)) for value in state.eigenvalues)
        return cls(**unchanged, eigenvalues=parts)


class BranchPointRecord(BaseModel):
    """A point of a branch: the value of its parameter and its steady state."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    value: float
    state: SteadyRecord

    @classmethod
    def of(cls, point: SteadyPoint) -> Self:
        """Record a point.

        Parameters
        ----------
        point : SteadyPoint

        Returns
        -------
        BranchPointRecord
        """
        return cls(value=point.parameter, state=SteadyRecord.of(point.state))

    def document(self, value_name: str) -> dict[str, Any]:
        """Return the point as flat JSON data.

        Parameters
        ----------
        value_name : str
            Name of the value of the parameter.

        Returns
        -------
        dict
        """
        return {value_name: self.value} | self.state.model_dump(mode="json")


class BranchSummary(BaseModel):
    """Everything about a branch except its arrays.  Its JSON is the attributes of the branch's files.

    Attributes
    ----------
    key : str
    created : datetime
    versions : dict of str to str
        Of the packages that the numbers depend on.
    results_revision : int
        The solver's `RESULTS_REVISION`.
    scene : Scene
        At the first point.
    parameter : str
        Dotted path of the number that changes.
    to : float or None
        Value at which the branch was to end; None if it was followed upward without an end.
    ended : str
        Why it was followed no farther.
    branch, folds, crossings : tuple of BranchPointRecord
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    key: str
    created: Timestamp
    versions: dict[str, str]
    results_revision: int
    scene: Scene
    parameter: str
    to: float | None
    ended: str
    branch: tuple[BranchPointRecord, ...]
    folds: tuple[BranchPointRecord, ...]
    crossings: tuple[BranchPointRecord, ...]

    def document(self) -> dict[str, Any]:
        """Return the summary as JSON data, each point with its results beside its value."""
        document = self.model_dump(mode="json", exclude={"branch", "folds", "crossings"})
        special = {
            name: [self._point(point, "value") for point in getattr(self, name)]
            for name in ("folds", "crossings")
        }
        return document | {"branch": [self._point(point, "parameter") for point in self.branch]} | special

    def measured_value(self, point: BranchPointRecord) -> Measured | None:
        """Return the value of the parameter at a point in the units of the scene.

        Parameters
        ----------
        point : BranchPointRecord

        Returns
        -------
        Measured or None
            None if it has no unit, or the units are not known.
        """
        return Measured.known(point.value, dimension_at(self.scene, self.parameter), self.scene.units)

    def in_units(self, units: Units | None) -> Self:
        """Return the branch as if its scene had other units, or none.

        Parameters
        ----------
        units : Units or None

        Returns
        -------
        BranchSummary
        """
        return self.model_copy(update={"scene": self.scene.model_copy(update={"units": units})})

    def _point(self, point: BranchPointRecord, value_name: str) -> dict[str, Any]:
        document = point.document(value_name)
        measured = measured_fields(point.state, document, self.scene.units)
        value = self.measured_value(point)
        return document | measured_document(measured | ({} if value is None else {value_name: value}))


def branch_key(scene: Scene, parameter: str, to: float | None) -> str:
    """Return the key of a branch: equal questions under one revision of the results share it.

    Parameters
    ----------
    scene : Scene
    parameter : str
    to : float or None

    Returns
    -------
    str
        32 hexadecimal digits.
    """
    identity = {
        "scene": json.loads(scene.model_dump_json(exclude={"units"})),
        "parameter": parameter,
        "to": to,
        "results_revision": RESULTS_REVISION,
    }
    text = json.dumps(identity, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:32]
