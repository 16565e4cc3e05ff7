"""Values read from the points of a boundary: a line through them, and critical values between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

import numpy as np
from numpy.polynomial import Polynomial
from pydantic import BaseModel

from ensemble.errors import BadInput
from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.search.critical_value import SearchStatus
from ensemble.search.line import Line, line_through

CACHED_BOUNDARIES = 256  # documents that are kept as they were sent


class BoundaryDocument(Boundary):
    """A boundary, and the line through its converged points if there are three or more."""

    fit: Line | None


class ReadingMethod(StrEnum):
    """How a critical value is read from a boundary."""

    INTERPOLATED = "interpolated"
    NEAREST = "nearest"


class CriticalValueDocument(BaseModel):
    """A critical value read from a boundary.

    Attributes
    ----------
    parameters : dict
        Value of the swept parameter: the requested one or, with ``nearest``, that of the nearest point.
    critical_value : float
    uncertainty : (float, float)
        Interval that contains the critical value: the bracket of a point; between two points the
        interpolated brackets, widened by the largest deviation of a parabola through a third point from
        the straight line.
    method : ReadingMethod
    points : list
        Parameters of the points that were used.
    """

    parameters: dict[str, float]
    critical_value: float
    uncertainty: tuple[float, float]
    method: ReadingMethod
    points: list[dict[str, float]]


@dataclass(frozen=True)
class _ConvergedPoint:
    """A point with a closed bracket, and the value of the swept parameter there."""

    swept: float
    value: float
    low: float
    high: float
    point: BoundaryPoint


@lru_cache(CACHED_BOUNDARIES)
def fitted_boundary(recorded: str) -> str:
    """Add the line through its points to a boundary.

    Parameters
    ----------
    recorded : str
        JSON of a `Boundary`.

    Returns
    -------
    str
        JSON of a `BoundaryDocument`.
    """
    boundary = Boundary.model_validate_json(recorded)
    document = BoundaryDocument.model_validate(boundary.model_dump() | {"fit": line_through(boundary)})
    return document.model_dump_json()


def critical_value_at(
    boundary: Boundary, parameters: Mapping[str, float], method: ReadingMethod
) -> CriticalValueDocument:
    """Read a critical value from the converged points of a boundary.

    Parameters
    ----------
    boundary : Boundary
    parameters : mapping
        Value of the swept parameter by its dotted path.
    method : ReadingMethod
        Interpolate between two points, or take the nearest point.

    Returns
    -------
    CriticalValueDocument

    Raises
    ------
    BadInput
        If other parameters are given than the swept one, or its value lies outside the converged points.
    """
    name = boundary.study["sweep"]["parameter"]
    if parameters.keys() != {name}:
        raise BadInput(f"give a value of {name} and of nothing else")
    points = _converged_points(boundary, name)
    if not points:
        raise BadInput(f"{name}: no point of this boundary has converged yet")
    swept = parameters[name]
    nearest = min(points, key=lambda point: abs(point.swept - swept))
    if method is ReadingMethod.NEAREST or nearest.swept == swept:
        return CriticalValueDocument(
            parameters=nearest.point.parameters,
            critical_value=nearest.value,
            uncertainty=(nearest.low, nearest.high),
            method=method,
            points=[nearest.point.parameters],
        )
    if not points[0].swept < swept < points[-1].swept:
        raise BadInput(
            f"{name}: {swept:g} — must lie within [{points[0].swept:g}, {points[-1].swept:g}], "
            "or ask for the nearest"
        )
    return _interpolated(points, name, swept)


def _converged_points(boundary: Boundary, name: str) -> list[_ConvergedPoint]:
    points = [
        _ConvergedPoint(point.parameters[name], point.critical_value, low, high, point)
        for point in boundary.points
        if point.status == SearchStatus.CONVERGED and point.critical_value is not None
        for low, high in [point.bracket]
        if low is not None and high is not None
    ]
    return sorted(points, key=lambda point: point.swept)


def _interpolated(points: list[_ConvergedPoint], name: str, swept: float) -> CriticalValueDocument:
    above = next(index for index, point in enumerate(points) if point.swept > swept)
    left, right = points[above - 1], points[above]
    ends = [left.swept, right.swept]
    value, low, high = (
        float(np.interp(swept, ends, [getattr(left, field), getattr(right, field)]))
        for field in ("value", "low", "high")
    )
    deviation = _parabola_deviation(points, above, swept, value)
    return CriticalValueDocument(
        parameters={name: swept},
        critical_value=value,
        uncertainty=(max(low - deviation, 0.0), high + deviation),
        method=ReadingMethod.INTERPOLATED,
        points=[left.point.parameters, right.point.parameters],
    )


def _parabola_deviation(points: list[_ConvergedPoint], above: int, swept: float, value: float) -> float:
    """Return how far a parabola through the two neighbors and a third point deviates from the line.

    There is a third point on the left, on the right, or on both sides; then the larger deviation counts.
    """
    starts = [start for start in (above - 2, above - 1) if start >= 0 and start + 3 <= len(points)]
    triples = [points[start : start + 3] for start in starts]
    parabolas = [
        Polynomial.fit([point.swept for point in triple], [point.value for point in triple], deg=2)
        for triple in triples
    ]
    return max((abs(float(parabola(swept)) - value) for parabola in parabolas), default=0.0)
