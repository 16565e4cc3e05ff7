"""Roots of functions of one variable.

SciPy has them, too, in a package whose import takes as long as a short run.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

_ROUND_OFF = 2 * float(np.finfo(np.float64).eps)  # relative


def root(function: Callable[[float], float], first: float, last: float, tolerance: float = 1e-12) -> float:
    """Return a root between two numbers, by inverse parabolas and bisection (Chandrupatla 1997).

    Parameters
    ----------
    function : callable
        Continuous.
    first, last : float
        Where its values have opposite signs, or one is zero.
    tolerance : float
        Largest distance of the result from a root, but no less than round-off allows.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If the values at both ends have the same sign.
    """
    a, b = last, first
    of_a, of_b = float(function(a)), float(function(b))
    if not of_a * of_b <= 0:
        raise ValueError(f"no change of sign between {first} and {last}: {of_b} and {of_a}")
    c, of_c = a, of_a
    fraction = 0.5
    while True:
        best, of_best = (a, of_a) if abs(of_a) < abs(of_b) else (b, of_b)
        least = (_ROUND_OFF * abs(best) + 0.5 * tolerance) / abs(b - a) if a != b else 1.0
        if least > 0.5 or of_best == 0:
            return best
        x = a + min(max(fraction, least), 1 - least) * (b - a)
        of_x = float(function(x))
        if (of_x > 0) == (of_a > 0):
            c, of_c = a, of_a
        else:
            c, of_c, b, of_b = b, of_b, a, of_a
        a, of_a = x, of_x
        fraction = _interpolated(a, b, c, of_a, of_b, of_c)


def _interpolated(a: float, b: float, c: float, of_a: float, of_b: float, of_c: float) -> float:
    """Return where on the way from a to b the inverse parabola has its root, ½ where it cannot be trusted."""
    place, height = (a - b) / (c - b), (of_a - of_b) / (of_c - of_b)
    if not (height**2 < place and (1 - height) ** 2 < 1 - place):
        return 0.5
    return of_a / (of_b - of_a) * of_c / (of_b - of_c) + (c - a) / (b - a) * of_a / (of_c - of_a) * of_b / (
        of_c - of_b
    )
