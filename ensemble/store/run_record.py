"""A run as files hold it: a summary (everything that is not an array) and arrays with named dimensions."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from typing import Annotated, Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from ensemble.config.measured import dimension_at
from ensemble.config.run_key import run_key
from ensemble.store.versions import result_versions
from ensemble.timestamp import Timestamp, now
from solver.analysis.recorded import RECORDED
from solver.analysis.run import (
    Arrangement,
    Array,
    Configuration,
    Energy,
    Errors,
    Frames,
    Outcome,
    Run,
    RunResults,
    Viscosity,
    Work,
)
from solver.dimensions import LENGTH, TIME, Dimension
from solver.revision import RESULTS_REVISION
from solver.scene import Scene, Units


class RunSummary(BaseModel):
    """Everything about a run except its arrays.  Its JSON is the attributes of the run's files.

    All results have the names and units that they have in `solver.analysis.run.Run`, and are None where they
    are None there.

    Attributes
    ----------
    key : str
    created : datetime
    versions : dict of str to str
        Of the packages that the numbers depend on.
    results_revision : int or None
        The solver's `RESULTS_REVISION`; None in records from before there was one.
    series, vesicle_series : tuple of str
        Names of the recorded diagnostics.
    report : str or None
        Name of the report that it was made for; None if it was asked for by itself or by a study.
    """

    # Strings keep NaN and infinity, which a failed run may carry, inside the JSON standard.
    model_config = ConfigDict(
        frozen=True, extra="forbid", ser_json_inf_nan="strings", serialize_by_alias=True
    )

    key: str
    created: Timestamp
    versions: dict[str, str]
    results_revision: int | None = None
    scene: Scene
    outcome: Outcome
    configuration: Configuration | None = None
    failure: str | None
    undecided: str | None = None
    time: Annotated[float, TIME]
    period: Annotated[float | None, TIME]
    settled: bool | None = None
    effective_aspect_ratio: float | None
    inclination_angle: float | None
    gap: Annotated[float | None, LENGTH]
    viscosity: Viscosity | None
    energy: Energy
    error: Errors
    work: Work
    sensitive: bool = False
    series: tuple[str, ...]
    vesicle_series: tuple[str, ...] = ()
    perturbations: tuple[Annotated[float, TIME], ...] = ()
    arrangement: Arrangement | None = None
    report: str | None = None

    def in_units(self, units: Units | None) -> Self:
        """Return the summary of the same run with other units, or none, of its scene.

        Parameters
        ----------
        units : Units or None

        Returns
        -------
        RunSummary
        """
        return self.model_copy(update={"scene": self.scene.model_copy(update={"units": units})})

    @property
    def wall_seconds(self) -> float:
        """Wall time that the simulation took."""
        return self.work.wall_seconds

    def document(self) -> dict[str, Any]:
        """Return the summary as strictly valid JSON data; floats keep every bit."""
        return dict(json.loads(self.model_dump_json()))

    @classmethod
    def of(cls, run: Run) -> Self:
        """Summarize a run that this process has just finished.

        Parameters
        ----------
        run : Run

        Returns
        -------
        RunSummary
        """
        return cls.of_parts(run, run.series, run.vesicle_series)

    @classmethod
    def of_parts(cls, run: RunResults, series: Iterable[str], vesicle_series: Iterable[str]) -> Self:
        """Summarize a run that this process has just finished.

        Parameters
        ----------
        run : RunResults
        series, vesicle_series : iterable of str
            Names of what it has recorded.

        Returns
        -------
        RunSummary
        """
        results = {name: getattr(run, name) for name in RESULTS}
        return cls(
            key=run_key(run.scene),
            created=now(),
            versions=result_versions(),
            results_revision=RESULTS_REVISION,
            series=tuple(sorted(series)),
            vesicle_series=tuple(sorted(vesicle_series)),
            **results,
        )


_OTHERS = ("key", "created", "versions", "results_revision", "series", "vesicle_series", "report")
# The fields of a run that its summary holds unchanged.
RESULTS = tuple(name for name in RunSummary.model_fields if name not in _OTHERS)


class Rows(Protocol):
    """An array, in memory or elsewhere, whose rows are read a few at a time.

    Attributes
    ----------
    shape : tuple of int
    dtype : numpy.dtype
    """

    @property
    def shape(self) -> tuple[int, ...]:
        """The length of each dimension."""

    @property
    def dtype(self) -> np.dtype[Any]:
        """The type of the numbers."""

    def __getitem__(self, rows: slice, /) -> NDArray[Any]:
        """Return successive rows.

        Parameters
        ----------
        rows : slice

        Returns
        -------
        array
        """


class NamedArray(NamedTuple):
    """An array and the names of its dimensions.

    Attributes
    ----------
    dimensions : tuple of str
    values : Rows
    attributes : dict
        JSON data, such as the units.
    """

    dimensions: tuple[str, ...]
    values: Rows
    attributes: dict[str, Any] = {}  # noqa: RUF012  it is never changed


# Dimension `frame_time` has a coordinate of its own name, as `time` has, so xarray indexes both.
FRAME_DIMENSIONS: Mapping[str, tuple[str, ...]] = {
    "frame_time": ("frame_time",),
    "tangent_angle": ("frame_time", "vesicle", "point"),
    "center": ("frame_time", "vesicle", "axis"),
    "tension": ("frame_time", "vesicle", "point"),
    # What follows from these.
    "x": ("frame_time", "vesicle", "point"),
    "y": ("frame_time", "vesicle", "point"),
    "bending_force": ("frame_time", "vesicle", "point", "axis"),
    "tension_force": ("frame_time", "vesicle", "point", "axis"),
    "adhesion_force": ("frame_time", "vesicle", "point", "axis"),
}


def arrays(run: Run) -> dict[str, NamedArray]:
    """Return the arrays of a run that are stored: diagnostics over `time`, then the frames over `frame_time`.

    Parameters
    ----------
    run : Run

    Returns
    -------
    dict of str to NamedArray
    """
    parts = {
        "series": run.series,
        "vesicle_series": run.vesicle_series,
        "frames": {field.name: getattr(run.frames, field.name) for field in fields(run.frames)},
    }
    return named_arrays(parts, run.scene.units)


def named_arrays(parts: Mapping[str, Mapping[str, Rows]], units: Units | None) -> dict[str, NamedArray]:
    """Return the arrays of a record by the names that they have in files.

    Parameters
    ----------
    parts : mapping of str to mapping of str to Rows
        The series, vesicle series and frames of a `Run`; the frames with what follows from them, if wanted.
    units : Units or None
        Of its scene.

    Returns
    -------
    dict of str to NamedArray
    """
    frames = {"frame_time" if name == "time" else name: values for name, values in parts["frames"].items()}
    named = (
        {name: NamedArray(("time",), values) for name, values in parts["series"].items()}
        | {
            name: NamedArray(("time", "vesicle", "axis")[: len(values.shape)], values)
            for name, values in parts.get("vesicle_series", {}).items()
        }
        | {name: NamedArray(FRAME_DIMENSIONS[name], values) for name, values in frames.items()}
    )
    return {name: array._replace(attributes=_attributes(name, units)) for name, array in named.items()}


def _attributes(name: str, units: Units | None) -> dict[str, Any]:
    """Return what an array measures and its units after the CF conventions, and those of the SI if known."""
    recorded = RECORDED.get(name)
    if recorded is None:
        return {}
    description, dimension = recorded
    return {"long_name": description} | _units(dimension, units)


def _units(dimension: Dimension, units: Units | None) -> dict[str, Any]:
    if units is None or dimension.is_pure:
        return {"units": dimension.symbol}
    return {"units": dimension.symbol, "si_units": dimension.si, "si_factor": units.scale(dimension)}


def parameter_attributes(scene: Scene, path: str) -> dict[str, Any]:
    """Return the attributes of an array of values of a parameter: its units, if it has any.

    Parameters
    ----------
    scene : Scene
        That has the parameter.
    path : str
        Its dotted path.

    Returns
    -------
    dict
        JSON data.
    """
    dimension = dimension_at(scene, path)
    return {} if dimension is None else _units(dimension, scene.units)


def rebuild(summary: RunSummary, read: Callable[[str], Array]) -> Run:
    """Put a run together again.

    Parameters
    ----------
    summary : RunSummary
    read : callable
        Reads an array by name.

    Returns
    -------
    Run
    """
    return Run(
        **{name: getattr(summary, name) for name in RESULTS},
        series={name: read(name) for name in summary.series},
        vesicle_series={name: read(name) for name in summary.vesicle_series},
        frames=Frames(
            time=read("frame_time"),
            tangent_angle=read("tangent_angle"),
            center=read("center"),
            tension=read("tension"),
        ),
    )


def first_problem(error: ValidationError) -> str:
    """Say on one line what is wrong with a record.

    Parameters
    ----------
    error : ValidationError
        What its model found.

    Returns
    -------
    str
        The first field that is wrong, and how.
    """
    first = error.errors(include_url=False)[0]
    return f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
