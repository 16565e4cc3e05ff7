"""Two long parallel membranes that adhere: the energy that they gain, and the distance at which they rest."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from solver.roots import root

_NEAREST = 0.02  # of δ: closer membranes are not looked at
_NODES = 128  # of Gauss and Legendre, on each part: exact to round-off for all power laws


class FlatMembranes(NamedTuple):
    """Two parallel membranes at rest.

    Attributes
    ----------
    energy : float
        Gained per area, over H; units of length.
    distance : float
        Between them, units of length.
    """

    energy: float
    distance: float


def at_rest(
    evaluate: Callable[[float], tuple[float, float, float]], distance: float, cutoff: float | None
) -> FlatMembranes:
    """Find the least energy of two parallel membranes, min ∫ φ(√(h² + s²))/H ds over their distance h.

    Parameters
    ----------
    evaluate : callable
        From r² to φ/H and its derivatives by r².
    distance : float
        δ, where φ is least.
    cutoff : float or None
        Where φ ends.

    Returns
    -------
    FlatMembranes

    Raises
    ------
    ValueError
        If they find no rest, because a weak repulsion lets them cross, or if the energy cannot be computed
        because the distance is too small or too large.
    """

    def integral(height: float, derivative: int) -> float:
        # With s = height·tan(angle) the interval is finite; it is divided where a cutoff begins and ends.
        end = math.pi / 2 if cutoff is None else math.acos(height / cutoff)
        total = 0.0
        for low, high in pairwise((0.0, math.acos(height / distance), end)):
            for node, weight in zip(*np.polynomial.legendre.leggauss(_NODES), strict=True):
                cosine = math.cos(low + (high - low) * (node + 1) / 2)
                value = evaluate((height / cosine) ** 2)[derivative]
                total += float(weight) * (high - low) * value * height / cosine**2
        return total  # of both sides

    closest = _NEAREST * distance
    energy = height = math.nan
    with suppress(ArithmeticError):
        slope = integral(closest, 1)
        if slope >= 0:
            raise ValueError("two flat membranes do not keep a distance, its repulsion is too weak")
        if math.isfinite(slope):
            height = root(lambda height: integral(height, 1), closest, distance, 1e-12 * distance)
            energy = -integral(height, 0)
    if not 0 < energy < math.inf:
        raise ValueError(f"distance {distance:g} is too small or too large for an energy of flat membranes")
    return FlatMembranes(energy, height)
