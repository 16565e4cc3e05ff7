"""Boundaries as they are sent."""

from __future__ import annotations

from functools import lru_cache

from ensemble.search.boundary import Boundary
from ensemble.search.line import Line, line_through

CACHED_BOUNDARIES = 256  # documents that are kept as they were sent


class BoundaryDocument(Boundary):
    """A boundary, and the line through its converged points if there are three or more."""

    fit: Line | None


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
