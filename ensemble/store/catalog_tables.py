"""The tables of the catalog and the fields of their documents."""

from __future__ import annotations

from typing import Any, NamedTuple

from sqlalchemy import JSON
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

from ensemble.search.boundary import Boundary
from ensemble.store.record_fields import model_fields
from ensemble.store.run_record import RunSummary
from solver.scene import Scene

# A filter names a field of the scene or a result; both have names of their own.
RUN_FIELDS = model_fields(Scene, "scene") | {
    name: field for name, field in model_fields(RunSummary).items() if name != "scene"
}
BOUNDARY_FIELDS = model_fields(Boundary)


class Table(DeclarativeBase):
    """Base of the tables.  They are what they have always been: what changes is in the documents."""

    type_annotation_map = {dict[str, Any]: JSON}  # noqa: RUF012


class RunRow(Table):
    """A committed run.

    Attributes
    ----------
    key : str
    created : str
        Moment as text.
    document : dict
        JSON of its summary.
    """

    __tablename__ = "runs"

    key: Mapped[str] = mapped_column(primary_key=True)
    created: Mapped[str] = mapped_column(index=True)
    document: Mapped[dict[str, Any]]


class BoundaryRow(Table):
    """The latest state of a study's boundary."""

    __tablename__ = "boundaries"

    study_key: Mapped[str] = mapped_column(primary_key=True)
    updated: Mapped[str] = mapped_column(index=True)
    document: Mapped[dict[str, Any]]


class Record(NamedTuple):
    """A run or a boundary as it was recorded.

    A field that a later version has added to the models is missing in it, and has its default.

    Attributes
    ----------
    key : str
    json : str
        Of the summary of a run, or of the boundary.
    """

    key: str
    json: str
