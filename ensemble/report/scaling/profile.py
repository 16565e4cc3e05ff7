"""Into what the time of an evaluation goes."""

from __future__ import annotations

import cProfile
import pstats
from collections import Counter
from collections.abc import Callable
from pathlib import PurePath

# Modules of the solver by what they do; compiled code counts for the module that calls it.
_KERNELS = (
    "adhesion",
    "close_evaluation",
    "direct_sum",
    "kernels",
    "multipoles",
    "neighbors",
    "proximity",
    "refinement",
    "single_layer",
    "stokes",
)
_SOLVES = ("tension",)
_COLLECTIVES = ("parallel", "counting")
PARTS = ("kernels", "collectives", "solves", "other")

_Function = tuple[str, int, str]


def shares_of_time(evaluate: Callable[[], object]) -> dict[str, float]:
    """Share of each of `PARTS` in the time of a call, on this rank."""
    profile = cProfile.Profile()
    profile.runcall(evaluate)
    spent: Counter[str] = Counter()
    for function, (_, _, own, _, callers) in pstats.Stats(profile).stats.items():  # type: ignore[attr-defined]
        if _is_ours(function) or not callers:
            spent[_part(function)] += own
        else:  # of a library: for whoever called it
            for caller, (_, _, for_caller, _) in callers.items():
                spent[_part(caller)] += for_caller
    total = sum(spent.values())
    return {part: spent[part] / total for part in PARTS}


def _is_ours(function: _Function) -> bool:
    return bool({"solver", "scaling"} & set(PurePath(function[0]).parts))


def _part(function: _Function) -> str:
    module = PurePath(function[0]).stem
    if not _is_ours(function):
        return "solves" if "scipy" in PurePath(function[0]).parts else "other"
    if module in _KERNELS:
        return "kernels"
    if module in _SOLVES:
        return "solves"
    return "collectives" if module in _COLLECTIVES else "other"
