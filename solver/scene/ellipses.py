"""How far apart the ellipses are as which vesicles start.

Two convex bodies are as far apart as the widest strip between them: the distance is the largest value over
unit directions n of n·(c₂ − c₁) − h₁(n) − h₂(n), where h is the support function, √(a²(n·u)² + b²(n·v)²) for
an ellipse with semi-axes a, b along u, v.  It is negative where they overlap.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from solver.roots import root

if TYPE_CHECKING:
    from solver.scene.vesicle import Vesicle

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_DIRECTIONS = 256  # among which the best is looked for before it is refined
_FEW_DIRECTIONS = 64  # where a lower bound will do
_GOLDEN = (np.sqrt(5) - 1) / 2
_REFINEMENTS = 40  # each narrows the interval of directions by the golden ratio


@lru_cache(1024)  # the vesicles of a scene, and the scenes of a study, are alike
def semi_axes(reduced_area: float, length: float) -> tuple[float, float]:
    """Return the semi-axes a ≥ b of the ellipse with this perimeter and reduced area.

    The perimeter is 4aE(m) with m = 1 − b²/a² (complete elliptic integral of the second kind), so the
    reduced area is π²√(1−m)/(4E(m)²), which falls from 1 to 0 as the aspect ratio falls.

    Parameters
    ----------
    reduced_area : float
        4π·area/length².
    length : float
        Perimeter.

    Returns
    -------
    major : float
    minor : float
    """
    from scipy.special import ellipe

    if reduced_area == 1.0:
        radius = length / (2 * np.pi)
        return radius, radius

    def excess(aspect: float) -> float:
        return float(np.pi**2 * aspect / (4 * ellipe(1 - aspect**2) ** 2) - reduced_area)

    aspect = root(excess, 1e-9, 1.0, 1e-16)
    major = length / (4 * ellipe(1 - aspect**2))
    return major, major * aspect


@dataclass(frozen=True)
class Ellipses:
    """Any number of ellipses in the complex plane.

    Attributes
    ----------
    center : complex (M,)
    axis : complex (M,)
        Unit vectors along the long axes.
    major, minor : (M,)
        Semi-axes.
    """

    center: ComplexArray
    axis: ComplexArray
    major: Array
    minor: Array

    @classmethod
    def of(cls, vesicles: Iterable[Vesicle]) -> Self:
        """Make the ellipses in whose shape and place vesicles start.

        Parameters
        ----------
        vesicles : iterable of Vesicle

        Returns
        -------
        Ellipses
        """
        placed = [(complex(*v.center), v.angle, *semi_axes(v.reduced_area, v.length)) for v in vesicles]
        center, angle, major, minor = (np.array(column) for column in zip(*placed, strict=True))
        return cls(center, np.exp(1j * angle), major, minor)

    def __getitem__(self, index: Any) -> Ellipses:
        """Return some of the ellipses."""
        return Ellipses(self.center[index], self.axis[index], self.major[index], self.minor[index])

    def support(self, direction: ComplexArray) -> Array:
        """Return how far each ellipse reaches from its center in given directions.

        Parameters
        ----------
        direction : complex (M,) or (M, directions)
            Unit vectors.

        Returns
        -------
        (M,) or (M, directions)
        """
        shape = (-1,) + (1,) * (direction.ndim - 1)
        along = direction * self.axis.conj().reshape(shape)
        return np.asarray(
            np.hypot(self.major.reshape(shape) * along.real, self.minor.reshape(shape) * along.imag)
        )


def _around(first: Ellipses, second: Ellipses) -> Array:
    """Return the distances between the circles around ellipses, the simplest lower bound."""
    return np.asarray(np.abs(first.center - second.center) - first.major - second.major)


def clearances(first: Ellipses, second: Ellipses) -> Array:
    """Return lower bounds of the distances between ellipses, too low by at most 1e-3 of their size.

    Parameters
    ----------
    first, second : Ellipses
        M each.

    Returns
    -------
    (M,)
    """
    return np.asarray(_strips(first, second, _FEW_DIRECTIONS)[0].max(axis=1))


def distances(first: Ellipses, second: Ellipses) -> Array:
    """Return the distances between ellipses, to round-off.

    Parameters
    ----------
    first, second : Ellipses
        M each.

    Returns
    -------
    (M,)
        Negative where they overlap.
    """
    widths, angles = _strips(first, second, _DIRECTIONS)
    step = 2 * np.pi / _DIRECTIONS
    low = angles[widths.argmax(axis=1)] - step
    high = low + 2 * step
    for _ in range(_REFINEMENTS):
        reach = _GOLDEN * (high - low)
        left, right = high - reach, low + reach
        leftward = _width(first, second, np.exp(1j * left)) > _width(first, second, np.exp(1j * right))
        low, high = np.where(leftward, low, left), np.where(leftward, right, high)
    return _width(first, second, np.exp(0.5j * (low + high)))


def overlapping_pair(vesicles: tuple[Vesicle, ...]) -> tuple[int, int] | None:
    """Return the indices of the first two ellipses that touch or overlap.

    Only neighbors are compared.  For most of them a lower bound of the distance is enough.

    Parameters
    ----------
    vesicles : tuple of Vesicle

    Returns
    -------
    (int, int) or None
        None if all are apart.
    """
    if len(vesicles) < 2:
        return None
    ellipses = Ellipses.of(vesicles)
    pairs = _neighbors(ellipses.center, 2 * float(ellipses.major.max()))
    for bound in (_around, clearances, distances):
        if not len(pairs):
            return None
        pairs = pairs[bound(ellipses[pairs[:, 0]], ellipses[pairs[:, 1]]) <= 0]
    return None if not len(pairs) else tuple(int(index) for index in min(pairs.tolist()))  # type: ignore[return-value]


def _neighbors(centers: ComplexArray, reach: float) -> NDArray[np.int64]:
    """Return the pairs (k, 2) of centers that are near along one axis, that on which all spread most.

    A tree would find fewer.  But every scene is checked, and to load one takes longer than to check a pair.
    """
    places = max(centers.real, centers.imag, key=np.ptp)
    order = np.argsort(places, kind="stable")
    sorted_places = places[order]
    first = np.arange(len(places))
    counts = np.searchsorted(sorted_places, sorted_places + reach, side="right") - first - 1
    steps = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    nearer = np.repeat(first, counts)
    return np.sort(order[np.stack([nearer, nearer + 1 + steps], axis=1)], axis=1)


def _strips(first: Ellipses, second: Ellipses, count: int) -> tuple[Array, Array]:
    """Return the widths (M, ``count``) of strips between ellipses, and the angles across which they lie."""
    angles = 2 * np.pi * np.arange(count) / count
    directions = np.broadcast_to(np.exp(1j * angles), (len(first.center), count))
    return _width(first, second, directions), angles


def _width(first: Ellipses, second: Ellipses, direction: ComplexArray) -> Array:
    offset = second.center - first.center
    across = (direction.conj().T * offset).T.real
    return np.asarray(across - first.support(direction) - second.support(direction))
