"""What is listed of a store."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

BATCH = 200  # records that are in memory at once, and the most in one query


_OF_REPORTS = re.compile(r"\s*report\s*[=!<>]")


def without_reports(where: Sequence[str]) -> tuple[str, ...]:
    """Return filters that leave out runs made for reports, unless one of them asks for these.

    Parameters
    ----------
    where : sequence of str
        Filters of runs, as `ensemble.store.filters.condition` takes them.

    Returns
    -------
    tuple of str
    """
    return tuple(where) if any(map(_OF_REPORTS.match, where)) else (*where, "report=null")


@dataclass(frozen=True)
class Listing:
    """Which records are listed, in which order, and how many.

    Attributes
    ----------
    where : tuple of str
        Filters that all of them meet, as `ensemble.store.filters.condition` takes them.
    sort : str or None
        Field by which they are sorted, as `ensemble.store.filters.order` takes it; None for the newest first.
    limit : int or None
        How many at most; None for all.
    """

    where: tuple[str, ...] = ()
    sort: str | None = None
    limit: int | None = None


class ParameterRange(NamedTuple):
    """Values of a number in a scene.

    Attributes
    ----------
    path : str
        Dotted path in the scene.
    low, high : float
        The least value and the largest one.
    """

    path: str
    low: float
    high: float
