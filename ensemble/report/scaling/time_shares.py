"""Shares of the parts of an evaluation in its time."""

from __future__ import annotations

import cProfile
import pstats
from collections import Counter
from collections.abc import Callable
from pathlib import PurePath

PARTS = ("kernels", "collectives", "solves", "other")

# The part to which a module belongs, by its name or else by its folder.  Compiled code counts for its caller.
_PART_OF_MODULE = {
    "tension": "solves",
    "summed_tension": "solves",
    "parallel": "collectives",
    "counting_ranks": "collectives",
}
_PART_OF_FOLDER = {"potentials": "kernels", "forces": "kernels", "scipy": "solves"}
_OWN_CODE = {"solver", "scaling"}  # folders; time in other code counts for its caller

_Function = tuple[str, int, str]


def time_shares(evaluate: Callable[[], object]) -> dict[str, float]:
    """Return the share of each of `PARTS` in the time of a call, on this rank.

    Parameters
    ----------
    evaluate : callable
        The call.

    Returns
    -------
    dict of str to float
        Shares by the name of the part; their sum is 1.
    """
    profile = cProfile.Profile()
    profile.runcall(evaluate)
    seconds: Counter[str] = Counter()
    for function, (_, _, own, _, callers) in pstats.Stats(profile).stats.items():  # type: ignore[attr-defined]
        if _is_own_code(function) or not callers:
            seconds[_part(function)] += own
        else:
            for caller, (_, _, for_caller, _) in callers.items():
                seconds[_part(caller)] += for_caller
    total = sum(seconds.values())
    return {part: seconds[part] / total for part in PARTS}


def _is_own_code(function: _Function) -> bool:
    return bool(_OWN_CODE & set(PurePath(function[0]).parts))


def _part(function: _Function) -> str:
    path = PurePath(function[0])
    if _is_own_code(function) and path.stem in _PART_OF_MODULE:
        return _PART_OF_MODULE[path.stem]
    return next((part for folder, part in _PART_OF_FOLDER.items() if folder in path.parts), "other")
