"""Which cells of a map are run: all that lie at a change of its labels.  Pure: no MPI, no files, no clock.

A map is a lattice of cells.  A coarse lattice is run first.  Then lattices follow in which the distances
of the cells are halved: a new cell whose neighbors on the former lattice have the same label is taken to have
it, too, and any other one is run.  On every lattice each cell that has a neighbor with another label is run,
until nothing changes.  In the end all cells at a change of the label are run, on both sides of it, and a cell
that is not run has the label of all its neighbors: four of them, or three at the rim of the map (its corners
are run).

The cells of a wave are all needed whatever their labels are.  The next wave follows from the labels of all
cells before it, so the map depends neither on the order of answers nor on the number of workers.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

Cell = tuple[int, int]  # its numbers along the two axes, from 0
Labels = NDArray[np.int64]

UNKNOWN: Final = -1


class MapRefinement:
    """Hands out the cells of a map that are to be run, and takes their labels in any order.

    Parameters
    ----------
    shape : (int, int)
        How many cells there are along each axis, 2 or more.
    scan : int
        Into how many parts each axis is divided at first.

    Attributes
    ----------
    labels : (columns, rows)
        Of the cells as far as they are known: `UNKNOWN`, or a number that stands for a label.
    made : (columns, rows) of bool
        Whether a cell has its label from a run; else it has that of its neighbors.
    """

    def __init__(self, shape: Cell, scan: int) -> None:
        self.labels: Labels = np.full(shape, UNKNOWN)
        self.made = np.zeros(shape, dtype=bool)
        self._lattice = [_first_lattice(length, scan) for length in shape]
        self._wave = {(int(x), int(y)) for x in self._lattice[0] for y in self._lattice[1]}

    @property
    def wave(self) -> frozenset[Cell]:
        """The cells whose labels are needed now; empty if the map is done."""
        return frozenset(self._wave)

    @property
    def done(self) -> bool:
        """Whether the map is done."""
        return not self._wave

    @property
    def cells_to_come(self) -> int:
        """How many cells are expected to be needed after the present wave."""
        x, y = np.meshgrid(*self._lattice, indexing="ij")
        at_changes = int(beside_changes(self.labels[x, y]).sum())
        gap = max(int(np.diff(lattice).max()) for lattice in self._lattice)
        # The next lattice has twice as many cells at changes, half of which are new, and so on.
        return at_changes * (2 ** math.ceil(math.log2(gap)) - 1)

    def tell(self, cell: Cell, label: int) -> None:
        """Take the label of a cell.

        Parameters
        ----------
        cell : (int, int)
            Of the present wave.
        label : int
            Of its run, 0 or more.
        """
        self._wave.remove(cell)
        self.labels[cell] = label
        self.made[cell] = True
        while not self._wave and self._go_on():
            pass

    def _go_on(self) -> bool:
        """Find the next wave, perhaps on the next lattice; return whether there may be one."""
        self._wave = set(self._at_changes())
        if self._wave:
            return True
        finer = [_finer(lattice) for lattice in self._lattice]
        if all(len(new) == len(old) for new, old in zip(finer, self._lattice, strict=True)):
            return False
        self._infer(*finer)
        self._lattice = finer
        x, y = np.meshgrid(*finer, indexing="ij")
        self._wave = set(_cells(x, y, self.labels[x, y] == UNKNOWN))
        return True

    def _at_changes(self) -> Iterator[Cell]:
        """Yield the cells of the lattice that have not been run, and have a neighbor with another label."""
        x, y = np.meshgrid(*self._lattice, indexing="ij")
        return _cells(x, y, beside_changes(self.labels[x, y]) & ~self.made[x, y])

    def _infer(self, x: Labels, y: Labels) -> None:
        """Give the new cells of a finer lattice the label of those around them if these have the same."""
        old_x, old_y = self._lattice
        lower_x, upper_x = _around(x, old_x)
        lower_y, upper_y = _around(y, old_y)
        corners = [
            self.labels[np.ix_(at_x, at_y)] for at_x in (lower_x, upper_x) for at_y in (lower_y, upper_y)
        ]
        agree = np.all([corner == corners[0] for corner in corners], axis=0)
        there = self.labels[np.ix_(x, y)]
        self.labels[np.ix_(x, y)] = np.where((there == UNKNOWN) & agree, corners[0], there)


def beside_changes(labels: Labels) -> NDArray[np.bool_]:
    """Return which cells have a neighbor along an axis with another label.

    Parameters
    ----------
    labels : (columns, rows)

    Returns
    -------
    (columns, rows) of bool
    """
    beside = np.zeros(labels.shape, dtype=bool)
    across, along = labels[1:] != labels[:-1], labels[:, 1:] != labels[:, :-1]
    beside[1:] |= across
    beside[:-1] |= across
    beside[:, 1:] |= along
    beside[:, :-1] |= along
    return beside


def _first_lattice(length: int, scan: int) -> Labels:
    return np.unique(np.linspace(0, length - 1, min(scan, length - 1) + 1).round().astype(np.int64))


def _finer(lattice: Labels) -> Labels:
    return np.union1d(lattice, (lattice[1:] + lattice[:-1]) // 2)


def _around(cells: Labels, lattice: Labels) -> tuple[Labels, Labels]:
    """Return the last cell of a lattice not after each cell, and the first one not before it."""
    lower = lattice[np.searchsorted(lattice, cells, side="right") - 1]
    return lower, lattice[np.searchsorted(lattice, cells, side="left")]


def _cells(x: Labels, y: Labels, chosen: NDArray[np.bool_]) -> Iterator[Cell]:
    return zip(x[chosen].tolist(), y[chosen].tolist(), strict=True)
