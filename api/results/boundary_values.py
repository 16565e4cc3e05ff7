"""What is read off the points of a boundary: a line through them, and values between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import Polynomial

from api.http.schemas import BoundaryDocument, CriticalValueAt, Method
from ensemble.errors import BadInput
from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.search.critical_value import Status
from ensemble.search.line import line_through

MOST_FITTED = 256  # boundaries that are kept as they were sent


@dataclass(frozen=True)
class _Known:
    """A point whose bracket is closed, and the value of the swept parameter there."""

    at: float
    value: float
    low: float
    high: float
    point: BoundaryPoint


def _known(boundary: Boundary) -> list[_Known]:
    swept = boundary.study["sweep"]["parameter"]
    points = [
        _Known(point.parameters[swept], point.critical_value, low, high, point)
        for point in boundary.points
        if point.status == Status.CONVERGED and point.critical_value is not None
        for low, high in [point.bracket]
        if low is not None and high is not None
    ]
    return sorted(points, key=lambda known: known.at)


@lru_cache(MOST_FITTED)
def fitted(recorded: str) -> str:
    """Add to the JSON of a boundary the line through its points."""
    boundary = Boundary.model_validate_json(recorded)
    document = BoundaryDocument.model_validate(boundary.model_dump() | {"fit": line_through(boundary)})
    return document.model_dump_json()


def critical_value_at(boundary: Boundary, parameters: Mapping[str, float], method: Method) -> CriticalValueAt:
    """Read a critical value off the converged points of a boundary.

    Parameters
    ----------
    boundary : Boundary
    parameters : mapping
        Value of the swept parameter, by its dotted path.
    method : Method
        Between two points, or of the nearest one.

    Raises
    ------
    BadInput
        If the parameters are not those of the boundary, or lie outside of what is known of it.
    """
    swept = boundary.study["sweep"]["parameter"]
    if parameters.keys() != {swept}:
        raise BadInput(f"give a value of {swept} and of nothing else")
    known = _known(boundary)
    if not known:
        raise BadInput(f"{swept}: no point of this boundary has converged yet")
    at = parameters[swept]
    nearest = min(known, key=lambda point: abs(point.at - at))
    if method is Method.NEAREST or nearest.at == at:
        return CriticalValueAt(
            parameters=nearest.point.parameters,
            critical_value=nearest.value,
            uncertainty=(nearest.low, nearest.high),
            method=method,
            points=[nearest.point.parameters],
        )
    if not known[0].at < at < known[-1].at:
        raise BadInput(
            f"{swept}: {at:g} — must lie within [{known[0].at:g}, {known[-1].at:g}], or ask for the nearest"
        )
    return _between(known, swept, at)


def _between(known: list[_Known], swept: str, at: float) -> CriticalValueAt:
    above = next(index for index, point in enumerate(known) if point.at > at)
    left, right = known[above - 1], known[above]
    ends = [left.at, right.at]
    value, low, high = (
        float(np.interp(at, ends, [getattr(left, name), getattr(right, name)]))
        for name in ("value", "low", "high")
    )
    bend = _bend(known, above, at, value)
    return CriticalValueAt(
        parameters={swept: at},
        critical_value=value,
        uncertainty=(max(low - bend, 0.0), high + bend),
        method=Method.INTERPOLATED,
        points=[left.point.parameters, right.point.parameters],
    )


def _bend(known: list[_Known], above: int, at: float, value: float) -> float:
    """How far a parabola through the two neighbors and the next point leaves the line; the worse of two."""
    starts = [start for start in (above - 2, above - 1) if start >= 0 and start + 3 <= len(known)]
    triples = [known[start : start + 3] for start in starts]
    parabolas = [
        Polynomial.fit([point.at for point in triple], [point.value for point in triple], deg=2)
        for triple in triples
    ]
    return max((abs(float(parabola(at)) - value) for parabola in parabolas), default=0.0)
