"""The integral of a cubic spline through values at any times."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

Array = NDArray[np.float64]

_FEWEST = 4  # values that a cubic spline needs; through fewer there is one polynomial


def spline_integral(times: Array, values: Array, first: float, last: float) -> Array:
    """Return the integral of the spline whose third derivative is continuous next to the ends ("not a knot").

    Parameters
    ----------
    times : (n,)
        Ascending, at least two.
    values : (n, k)
    first, last : float
        Limits of the integral.

    Returns
    -------
    (k,)
    """
    steps = np.diff(times)[:, None]
    chords = np.diff(values, axis=0) / steps
    slopes = _slopes(times, steps, chords)
    begin, end = slopes[:-1], slopes[1:]
    # Of each piece, by the time since its beginning.
    coefficients = (
        values[:-1],
        begin,
        (3 * chords - 2 * begin - end) / steps,
        (begin + end - 2 * chords) / steps**2,
    )

    def up_to(piece: int | slice, since: float | Array) -> Array:
        return np.asarray(sum(c[piece] * since ** (k + 1) / (k + 1) for k, c in enumerate(coefficients)))

    before = np.concatenate([np.zeros_like(values[:1]), np.cumsum(up_to(slice(None), steps), axis=0)])
    pieces = np.clip(np.searchsorted(times, [first, last], side="right") - 1, 0, len(steps) - 1)
    to_first, to_last = (
        before[piece] + up_to(int(piece), limit - times[piece])
        for piece, limit in zip(pieces, (first, last), strict=True)
    )
    return np.asarray(to_last - to_first)


def _slopes(times: Array, steps: Array, chords: Array) -> Array:
    """Return the derivatives (n, k) at the times, from steps (n − 1, 1) and chords (n − 1, k)."""
    if len(times) < _FEWEST:
        bend = np.diff(chords, axis=0)[:1] / (times[-1] - times[0]) if len(times) > 2 else 0.0
        return np.concatenate([chords[:1] - bend * steps[0], chords + bend * steps])
    h = steps[:, 0]
    banded, right = np.zeros((3, len(times))), np.empty((len(times), chords.shape[1]))
    banded[0, 2:], banded[1, 1:-1], banded[2, :-2] = h[:-1], 2 * (h[:-1] + h[1:]), h[1:]
    right[1:-1] = 3 * (steps[1:] * chords[:-1] + steps[:-1] * chords[1:])
    both = times[2] - times[0]
    banded[0, 1], banded[1, 0] = both, h[1]
    right[0] = ((h[0] + 2 * both) * h[1] * chords[0] + h[0] ** 2 * chords[1]) / both
    both = times[-1] - times[-3]
    banded[2, -2], banded[1, -1] = both, h[-2]
    right[-1] = ((h[-1] + 2 * both) * h[-2] * chords[-1] + h[-1] ** 2 * chords[-2]) / both
    return np.asarray(solve_banded((1, 1), banded, right))
