"""Pairs that are bound in shear, for which the report tells whether their symmetry is stable.

Those of the default study are the upper ends of its brackets, in numbers: the report repeats no search.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from ensemble.config.documents import load_scene, load_study
from ensemble.config.run_key import run_key
from ensemble.report.stability.stability_document import PairSymmetry
from ensemble.report.timed_runs import TimedRuns
from solver.analysis.run import Run
from solver.scene import Scene
from solver.simulation.broken_symmetry import symmetry_breaking

# By shear rate: the upper end of the bracket that `ensemble bisect` finds.  At 0.25 it is the value above
# that: at the end itself the pair is bound at finer numerics only.
UPPER_ENDS = {
    0.25: 0.18873918221350972,
    0.5: 0.36699079598130596,
    0.75: 0.5351164180231388,
    1.0: 0.699564215671263,
    1.25: 0.8616776482670868,
    1.5: 1.0200481902173963,
}

_STRONGER = (1.5, 3.0)  # multiples of these
_OTHERS: tuple[tuple[str, dict[str, Any]], ...] = (
    *((f"reduced area {area:g}", {"vesicles.reduced_area": area}) for area in (0.75, 0.8, 0.85, 0.95)),
    *(
        (f"viscosity contrast {contrast:g}", {"vesicles.viscosity_contrast": contrast})
        for contrast in (0.5, 2.0)
    ),
    *((f"distance {distance:g}", {"adhesion.distance": distance}) for distance in (0.2, 0.3)),
)
_STUDY, _BEYOND = "default study", "beyond"
_HORIZON = 6400.0  # that of the study
_RATE, _HAMAKER = 0.5, 1.0  # of the others


class BoundPair(NamedTuple):
    """A pair with the names of its group and of itself."""

    group: str
    name: str
    scene: Scene


def bound_pairs(quick: bool) -> Iterator[BoundPair]:
    """Yield the pairs of the report.

    Parameters
    ----------
    quick : bool
        Yield one of the study, and two others.

    Yields
    ------
    BoundPair
    """
    study = load_study("critical-hamaker")
    ends = {1.0: UPPER_ENDS[1.0]} if quick else UPPER_ENDS
    for rate, hamaker in ends.items():
        yield BoundPair(_STUDY, f"shear rate {rate:g}, H {hamaker:.4g}", study.scene_at((rate,), hamaker))
    for rate, hamaker in ends.items():
        for stronger in [multiple * hamaker for multiple in _STRONGER[: 1 if quick else None]]:
            name = f"shear rate {rate:g}, H {stronger:.4g}"
            yield BoundPair(_BEYOND, name, _pair({"flow.rate": rate, "adhesion.hamaker": stronger}))
    for name, fields in _OTHERS[: 1 if quick else None]:
        scene = _pair({"flow.rate": _RATE, "adhesion.hamaker": _HAMAKER} | fields)
        yield BoundPair(_BEYOND, f"{name}, shear rate {_RATE:g}, H {_HAMAKER:g}", scene)


def _pair(fields: dict[str, Any]) -> Scene:
    changes = {"horizon": _HORIZON} | fields
    return load_scene("doublet-shear", [f"{path}={value!r}" for path, value in changes.items()])


def pair_symmetry(runs: TimedRuns, pair: BoundPair) -> PairSymmetry:
    """Find out whether a pair returns to its symmetry.

    Parameters
    ----------
    runs : TimedRuns
        Makes the runs.
    pair : BoundPair
        The pair.

    Returns
    -------
    PairSymmetry
        What becomes of a difference between its vesicles.
    """
    run = runs.run(pair.scene, f"{pair.group}: {pair.name}")
    found: dict[str, Any]
    if run.settled:
        found = _followed(run)
    else:
        found = {"reason": f"not settled: {run.failure or run.undecided or run.outcome}"}
    return PairSymmetry(
        group=pair.group,
        scene=pair.name,
        outcome=run.outcome,
        period=run.period,
        wall_seconds=run.work.wall_seconds,
        run_key=run_key(pair.scene),
        **found,
    )


def _followed(run: Run) -> dict[str, Any]:
    try:
        return dict(symmetry_breaking(run).record())
    except ArithmeticError as error:
        return {"reason": str(error)}
