"""What is listed of a store."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

BATCH = 200  # records that are in memory at once, and the most in one query


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
