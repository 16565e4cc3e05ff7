"""Delays before something is tried again: they grow, and differ, so that not all come back at once."""

from __future__ import annotations

import random


def growing_delay(tries: int, longest: float) -> float:
    """Return how long to wait before the next try: a second, and twice as long after each further one.

    Parameters
    ----------
    tries : int
        How many tries have failed; at least 1.
    longest : float
        The most that is waited, in seconds.

    Returns
    -------
    float
        Seconds, between half of that delay and all of it.
    """
    return min(2.0 ** min(tries - 1, 30), longest) * random.uniform(0.5, 1.0)
