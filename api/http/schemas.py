"""What the service takes and answers, beside the models of `ensemble` and `solver` themselves."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Any, Generic, Self, TypeVar

from pydantic import BaseModel, Field, JsonValue, model_validator

from api.jobs.job import Kind
from ensemble.config.study import Study
from ensemble.search.boundary import Boundary
from ensemble.search.line import Line
from solver.scene import Model, Scene

Item = TypeVar("Item")


class Page(BaseModel, Generic[Item]):
    """A part of a collection; `next` is the address of the part that follows, null after the last."""

    items: list[Item]
    next: str | None


class Submission(Model):
    """What to simulate: a preset by its name, a study or a scene, with changes by dotted path.

    Exactly one of `preset`, `study` and `scene` is given.  `ranks` and `seconds` are how many processes the
    job may use and how long it may run; left out, a study takes all that a job may have, a scene one.
    """

    preset: str | None = None
    study: Study | None = None
    scene: Scene | None = None
    set: dict[Annotated[str, Field(max_length=200)], JsonValue] = Field({}, max_length=100)
    ranks: int | None = Field(None, ge=1)
    seconds: float | None = Field(None, gt=0)

    @model_validator(mode="after")
    def _one_document(self) -> Self:
        given = [name for name in ("preset", "study", "scene") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"give one of preset, study and scene, not {' and '.join(given) or 'none'}")
        return self


class Estimate(BaseModel):
    """What a job may cost at most: points × vesicles × time to simulate, over all its `runs`.

    A job whose `cost` is above `maximum` is refused.
    """

    runs: int
    cost: float
    maximum: float
    accepted: bool


class Preset(BaseModel):
    """A study or a scene that ships with the package, in full, and what it may cost."""

    name: str
    kind: Kind
    document: dict[str, Any]
    estimate: Estimate


class BoundaryDocument(Boundary):
    """A boundary, and the line through its converged points if there are three or more."""

    fit: Line | None


class Method(StrEnum):
    """How a critical value is read off a boundary."""

    INTERPOLATED = "interpolated"
    NEAREST = "nearest"


class CriticalValueAt(BaseModel):
    """A critical value read off a boundary.

    Attributes
    ----------
    parameters : dict
        Where it holds: what was asked for or, of the nearest point, that point's own.
    critical_value : float
    uncertainty : (float, float)
        Between which values it lies: the bracket of a point; between points the interpolated brackets,
        widened by how far a parabola through the next point leaves the straight line.
    points : list
        Parameters of the points it was read from.
    """

    parameters: dict[str, float]
    critical_value: float
    uncertainty: tuple[float, float]
    method: Method
    points: list[dict[str, float]]


class SeriesDocument(BaseModel):
    """Diagnostics over time by name; null where a value is not finite."""

    series: dict[str, list[float | None]]


class FramesDocument(BaseModel):
    """Recorded states: the membranes' points in the plane and the tension there.

    Attributes
    ----------
    index : (frames,)
        Number of each frame in the run.
    time : (frames,)
    position : (frames, vesicles, 2, points)
        x of all points, then y.
    tension : (frames, vesicles, points)
    total : int
        Number of frames that the run has.
    """

    index: list[int]
    time: list[float | None]
    position: list[list[list[list[float | None]]]]
    tension: list[list[list[float | None]]]
    total: int


class Health(BaseModel):
    """Whether the service is up."""

    status: str
