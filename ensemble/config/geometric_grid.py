"""The fixed values that a search may try.

A value on a grid is a pure function of its index, the same to the last bit in every process, so searches
started from different guesses end in the same bracket and share their runs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Context
from functools import cached_property, lru_cache

# A library's binary power may differ in the last bit from machine to machine; correctly rounded decimal
# arithmetic with digits to spare does not.
_DECIMAL = Context(prec=34)


@lru_cache(8192)
def _grid_value(index: int, points_per_decade: int) -> float:
    return float(_DECIMAL.power(10, _DECIMAL.divide(index, points_per_decade)))


@dataclass(frozen=True)
class GeometricGrid:
    """Values 10^(index/points_per_decade), so index 0 is the origin 1.0.

    There are just as many points per decade as bring neighbors closer than the tolerance:
    (high − low)/low < tolerance.

    Attributes
    ----------
    tolerance : float
        Relative distance that neighbors stay below, > 0.

    Raises
    ------
    ValueError
        If the tolerance is not a positive number.
    """

    tolerance: float

    def __post_init__(self) -> None:
        if not 0 < self.tolerance < math.inf:
            raise ValueError(f"tolerance: {self.tolerance} — must be a number greater than 0")

    @cached_property
    def points_per_decade(self) -> int:
        """Number of grid steps between a value and ten times that value."""
        return math.floor(math.log(10) / math.log1p(self.tolerance)) + 1

    def value(self, index: int) -> float:
        """Return the value at an index.

        Parameters
        ----------
        index : int
            Any integer.

        Returns
        -------
        float
            The same to the last bit on every machine.
        """
        return _grid_value(index, self.points_per_decade)

    def position(self, value: float) -> float:
        """Return where a value lies on the grid.

        Parameters
        ----------
        value : float
            Positive.

        Returns
        -------
        float
            An index, with its fraction where the value lies between two values of the grid.
        """
        return self.points_per_decade * math.log10(value)

    def nearest(self, value: float) -> int:
        """Return the index of the grid value whose ratio to a value is closest to 1.

        Parameters
        ----------
        value : float
            Positive.

        Returns
        -------
        int
            Index of the grid value.
        """
        return round(self.position(value))

    def index(self, value: float) -> int:
        """Return the index of a value on the grid.

        Parameters
        ----------
        value : float
            A value of this grid.

        Returns
        -------
        int
            Its index.

        Raises
        ------
        ValueError
            If the value is not, to the last bit, a value of this grid.
        """
        if 0 < value < math.inf:
            index = self.nearest(value)
            if self.value(index) == value:
                return index
        raise ValueError(f"{value!r} is not on the grid of {self.points_per_decade} values a decade from 1.0")

    def within(self, low: float, high: float) -> range:
        """Return the indices of all values in an interval.

        Parameters
        ----------
        low, high : float
            Its ends, which belong to it, both positive.

        Returns
        -------
        range
            Indices, ascending.
        """
        first, last = self.nearest(low), self.nearest(high)
        return range(first + (self.value(first) < low), last + 1 - (self.value(last) > high))
