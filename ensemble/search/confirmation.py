"""Confirmation of the ends of brackets whose runs are sensitive: they are run again at finer numerics.

What finer means is in `ensemble.config.certifying_scene`.  Pure: no MPI, no files, no clock.
"""

from __future__ import annotations

from ensemble.search.critical_value import Side

CONFIRMING = "confirming"  # the status of a point whose ends are being confirmed


class Confirmation:
    """Values whose sides are to be confirmed; all of them are needed, whatever the others come to.

    Attributes
    ----------
    values : set of float
    sides : dict of float to Side
        At the finer numerics, as far as they are known.
    """

    def __init__(self) -> None:
        self.values: set[float] = set()
        self.sides: dict[float, Side] = {}
        self._pending: set[float] = set()

    def add(self, value: float) -> None:
        """Have a value confirmed.

        Parameters
        ----------
        value : float
        """
        self.values.add(value)

    def ask(self) -> float | None:
        """Return a value to try now and mark it as pending; None if there is none."""
        waiting = self.values - self._pending - self.sides.keys()
        if not waiting:
            return None
        value = min(waiting)
        self._pending.add(value)
        return value

    def tell(self, value: float, side: Side) -> None:
        """Take the answer at the finer numerics for a value.

        Parameters
        ----------
        value : float
            One of the values.
        side : Side
            On which it lies at the finer numerics.
        """
        self._pending.discard(value)
        self.sides[value] = side

    def withdraw(self, value: float) -> None:
        """Give back a pending value whose run was cancelled or lost; it may be asked for again.

        Parameters
        ----------
        value : float
            A pending one.
        """
        self._pending.remove(value)

    def unneeded(self) -> frozenset[float]:
        """Return nothing: every value is needed."""
        return frozenset()

    @property
    def values_left(self) -> int:
        """How many values are not known yet."""
        return len(self.values - self.sides.keys())

    @property
    def done(self) -> bool:
        """Whether no further answer is needed."""
        return not self.values_left
