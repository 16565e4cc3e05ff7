"""Critical values read from a boundary: at one of its points, or between them by interpolation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import StrEnum
from itertools import groupby
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from pydantic import BaseModel

from ensemble.errors import BadInput
from ensemble.search.boundary import Boundary
from ensemble.search.critical_value import SearchStatus

Place = tuple[float, ...]  # the value of each swept parameter


class ReadingMethod(StrEnum):
    """How a critical value is read from a boundary."""

    INTERPOLATED = "interpolated"
    NEAREST = "nearest"


class CriticalValueDocument(BaseModel):
    """A critical value read from a boundary.

    Attributes
    ----------
    parameters : dict
        Values of the swept parameters: the requested ones or, with ``nearest``, those of the nearest point.
    critical_value : float
    uncertainty : (float, float)
        Interval that contains the critical value: the bracket of a point; between points the interpolated
        brackets, widened for each parameter by the largest deviation of a parabola through a third point
        from the straight line.
    method : ReadingMethod
    points : list
        Parameters of the points that were used.
    """

    parameters: dict[str, float]
    critical_value: float
    uncertainty: tuple[float, float]
    method: ReadingMethod
    points: list[dict[str, float]]


class _Reading(NamedTuple):
    """A critical value, the ends of its uncertainty, and the places of the points from which it is read."""

    value: float
    low: float
    high: float
    points: tuple[Place, ...]


def critical_value_at(
    boundary: Boundary, parameters: Mapping[str, float], method: ReadingMethod
) -> CriticalValueDocument:
    """Read a critical value from the converged points of a boundary.

    Parameters
    ----------
    boundary : Boundary
    parameters : mapping
        Values of the swept parameters by their dotted paths.
    method : ReadingMethod
        Interpolate between points, linearly in each parameter, or take the nearest point.  Distances are
        compared as fractions of the range of each parameter.

    Returns
    -------
    CriticalValueDocument

    Raises
    ------
    BadInput
        If other parameters are given than the swept ones, or there are no converged points around the place.
    """
    names = boundary.swept
    if parameters.keys() != set(names):
        raise BadInput(f"give a value of {' and of '.join(names)} and of nothing else")
    at = tuple(parameters[name] for name in names)
    points = _converged_points(boundary)
    if not points:
        raise BadInput(f"{', '.join(names)}: no point of this boundary has converged yet")
    if method is ReadingMethod.NEAREST:
        at = _nearest(points, at)
    reading = _read(points, at)
    if reading is None:
        raise BadInput(_outside(names, points, at))
    return CriticalValueDocument(
        parameters=dict(zip(names, at, strict=True)),
        critical_value=reading.value,
        uncertainty=(max(reading.low, 0.0), reading.high),
        method=method,
        points=[dict(zip(names, place, strict=True)) for place in reading.points],
    )


def _converged_points(boundary: Boundary) -> dict[Place, _Reading]:
    """Return the points with a closed bracket, in the order of their places."""
    points = {
        place: _Reading(point.critical_value, low, high, (place,))
        for point in boundary.points
        if point.status == SearchStatus.CONVERGED and point.critical_value is not None
        for place in [boundary.place(point)]
        for low, high in [point.bracket]
        if low is not None and high is not None
    }
    return dict(sorted(points.items()))


def _nearest(points: Mapping[Place, _Reading], at: Place) -> Place:
    places = np.array(list(points))
    extent = np.ptp(places, axis=0)
    distances = np.linalg.norm((places - at) / np.where(extent > 0, extent, 1.0), axis=1)
    return list(points)[int(np.argmin(distances))]


def _outside(names: Sequence[str], points: Mapping[Place, _Reading], at: Place) -> str:
    for name, value, known in zip(names, at, zip(*points, strict=True), strict=True):
        if not min(known) <= value <= max(known):
            return (
                f"{name}: {value:g} — must lie within [{min(known):g}, {max(known):g}], "
                "or ask for the nearest"
            )
    return f"{', '.join(names)}: not all points around this place have converged; ask for the nearest"


def _read(points: Mapping[Place, _Reading], at: Place) -> _Reading | None:
    """Read along the first parameter, from what is read at each of its values along the others."""
    if at == ():
        return points[()]
    here, *rest = at
    line = []
    for value, group in groupby(points, key=lambda place: place[0]):
        reading = _read({place[1:]: points[place] for place in group}, tuple(rest))
        if reading is not None:
            line.append((value, reading))
    exact = [reading for value, reading in line if value == here]
    return exact[0] if exact else _interpolated(line, here)


def _interpolated(line: Sequence[tuple[float, _Reading]], at: float) -> _Reading | None:
    above = next((index for index, (value, _) in enumerate(line) if value > at), 0)
    if above == 0:  # it lies outside
        return None
    (first, left), (second, right) = line[above - 1 : above + 1]
    value, low, high = (
        float(np.interp(at, [first, second], [getattr(left, field), getattr(right, field)]))
        for field in ("value", "low", "high")
    )
    deviation = _parabola_deviation(line, above, at, value)
    return _Reading(value, low - deviation, high + deviation, left.points + right.points)


def _parabola_deviation(line: Sequence[tuple[float, _Reading]], above: int, at: float, value: float) -> float:
    """Return how far a parabola through the two neighbors and a third point deviates from the line.

    There is a third point on the left, on the right, or on both sides; then the larger deviation counts.
    """
    starts = [start for start in (above - 2, above - 1) if start >= 0 and start + 3 <= len(line)]
    triples = [line[start : start + 3] for start in starts]
    parabolas = [
        Polynomial.fit([place for place, _ in triple], [reading.value for _, reading in triple], deg=2)
        for triple in triples
    ]
    return max((abs(float(parabola(at)) - value) for parabola in parabolas), default=0.0)
