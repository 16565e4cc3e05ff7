"""What becomes of stiff and extreme scenes: outcome, errors, and whether the answer can be trusted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum

import numpy as np

from ensemble.config.run_key import run_key
from ensemble.report.machine import Machine
from ensemble.report.report_model import Document
from ensemble.report.runs import Runs
from solver.analysis.run import LARGEST_SPATIAL, Outcome, Run
from solver.scene import Scene

QUICK_WORK_LIMIT = 3_000  # evaluations

LARGEST_DRIFT = 1e-2  # of area (relative) and closure (over length)
LARGEST_RISE = 1e-3  # of the energy at rest, over its largest magnitude


class StabilityVerdict(StrEnum):
    """How far a run can be trusted; `CRITERIA` says when."""

    FINE = "fine"
    SPACE = "unresolved in space"
    TIME = "unresolved in time"
    FAILED = "failed"


# In the order in which they are asked: the first that holds is the verdict.
CRITERIA: Mapping[StabilityVerdict, str] = {
    StabilityVerdict.FAILED: "the run gave up, for the reason stated, or raised an error",
    StabilityVerdict.SPACE: (
        f"the spatial error exceeds {LARGEST_SPATIAL:g}: that is the amplitude (rad) of the last third of "
        "the tangent angle's spectrum, or the relative error across a vesicle's waist or of adhesion at the "
        "smallest gap, whichever is largest"
    ),
    StabilityVerdict.TIME: (
        f"resolved in space, yet area or closure drift by more than {LARGEST_DRIFT:g}, or the energy of a "
        f"scene at rest rises by more than {LARGEST_RISE:g} of its largest magnitude"
    ),
    StabilityVerdict.FINE: "none of these",
}


class Row(Document):
    """One scene.  A quantity that the scene does not have, or that is not finite, is None.

    energy_rise : largest rise above an earlier energy at rest, over the energy's largest magnitude.
    """

    group: str
    scene: str
    verdict: StabilityVerdict
    reason: str
    outcome: Outcome
    failure: str | None
    time: float | None = None
    horizon: float
    area_error: float | None = None
    closure_error: float | None = None
    temporal_error: float | None = None
    spatial_error: float | None = None
    smallest_gap: float | None = None
    energy_rise: float | None = None
    smallest_step: float | None = None
    steps: int | None = None
    evaluations: int | None = None
    wall_seconds: float | None = None
    run_key: str | None = None


class Stability(Document):
    """The whole report."""

    report: str = "stability"
    machine: Machine
    criteria: Mapping[StabilityVerdict, str]
    rows: list[Row]


def stability(runs: Runs, groups: Mapping[str, Mapping[str, Scene]]) -> Stability:
    """Run every scene to its end and judge it."""
    rows = [
        _row(runs, group, name, scene) for group, scenes in groups.items() for name, scene in scenes.items()
    ]
    return Stability(machine=Machine.here(), criteria=CRITERIA, rows=rows)


def quick_groups(groups: Mapping[str, Mapping[str, Scene]]) -> dict[str, dict[str, Scene]]:
    """Return the first scene of each group, with less work allowed."""
    return {group: dict([_limited(*next(iter(scenes.items())))]) for group, scenes in groups.items()}


def _limited(name: str, scene: Scene) -> tuple[str, Scene]:
    numerics = scene.numerics.model_copy(update={"work_limit": QUICK_WORK_LIMIT})
    return name, scene.model_copy(update={"numerics": numerics})


def _row(runs: Runs, group: str, name: str, scene: Scene) -> Row:
    try:
        run = runs.run(scene, f"{group}: {name}")
    except Exception as error:  # one scene that breaks the solver must not hide the others
        failure = f"raised {type(error).__name__}: {error}"
        return Row(
            group=group,
            scene=name,
            verdict=StabilityVerdict.FAILED,
            reason=failure,
            outcome=Outcome.FAILED,
            failure=failure,
            horizon=scene.horizon,
        )
    smallest_gap = float(np.min(run.series["gap"])) if "gap" in run.series else None
    rise = energy_rise(run) if scene.flow is None else None
    verdict, reason = judge(run, rise)
    return Row(
        group=group,
        scene=name,
        verdict=verdict,
        reason=reason,
        outcome=run.outcome,
        failure=run.failure,
        time=run.time,
        horizon=scene.horizon,
        area_error=_finite(run.error.area),
        closure_error=_finite(run.error.closure),
        temporal_error=_finite(run.error.temporal),
        spatial_error=_finite(run.error.spatial),
        smallest_gap=_finite(smallest_gap),
        energy_rise=_finite(rise),
        smallest_step=run.work.smallest_step,
        steps=run.work.steps,
        evaluations=run.work.rhs_evaluations,
        wall_seconds=run.work.wall_seconds,
        run_key=run_key(scene),
    )


def energy_rise(run: Run) -> float:
    """Largest rise of the total energy above an earlier value, over its largest magnitude."""
    energy = run.series["bending_energy"] + run.series.get("adhesion_energy", 0.0)
    return float(np.max(energy - np.minimum.accumulate(energy)) / np.max(np.abs(energy)))


def judge(run: Run, rise: float | None) -> tuple[StabilityVerdict, str]:
    """Verdict by `CRITERIA` and what it rests on.

    Parameters
    ----------
    run : Run
    rise : float or None
        See `energy_rise`; None in a flow.
    """
    if run.outcome is Outcome.FAILED:
        return StabilityVerdict.FAILED, run.failure or "no reason given"
    # Written so that NaN, which compares as false, never passes.
    if not run.error.spatial <= LARGEST_SPATIAL:
        return StabilityVerdict.SPACE, f"spatial error {run.error.spatial:.1e}"
    if not run.error.area <= LARGEST_DRIFT:
        return StabilityVerdict.TIME, f"area drift {run.error.area:.1e}"
    if not run.error.closure <= LARGEST_DRIFT:
        return StabilityVerdict.TIME, f"closure {run.error.closure:.1e}"
    if rise is not None and not rise <= LARGEST_RISE:
        return StabilityVerdict.TIME, f"energy rises by {rise:.1e}"
    return StabilityVerdict.FINE, ""


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
