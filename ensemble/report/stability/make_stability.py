"""Makes the stability report and writes it into the store."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from ensemble.config.run_key import run_key
from ensemble.report import ReportName, report_directory
from ensemble.report.report_files import FinishedReport, write_report
from ensemble.report.report_model import Machine
from ensemble.report.stability.bound_pairs import bound_pairs, pair_symmetry
from ensemble.report.stability.extreme_scenes import EXTREME_SCENES
from ensemble.report.stability.stability_conclusions import stability_conclusions
from ensemble.report.stability.stability_document import (
    CRITERIA,
    LARGEST_DRIFT,
    LARGEST_RISE,
    SceneVerdict,
    Stability,
    StabilityVerdict,
)
from ensemble.report.stability.stability_figures import stability_figure
from ensemble.report.stability.stability_text import stability_text
from ensemble.report.timed_runs import TimedRuns
from ensemble.store import Store
from solver.analysis.run import LARGEST_SPATIAL, Outcome, Run
from solver.scene import Scene

QUICK_WORK_LIMIT = 3_000  # evaluations of the right-hand side

SceneGroups = Mapping[str, Mapping[str, Scene]]


def make_stability(store: Store, quick: bool, log: Callable[[str], None]) -> FinishedReport:
    """Make the runs that the store does not have, then write ``reports/stability/`` in the store.

    The files are ``report.md``, ``report.html``, ``report.json`` and the figure, as PNG and as
    SVG; each appears complete or not at all.

    Parameters
    ----------
    store : Store
        The store that keeps runs and report.
    quick : bool
        Make one scene of each group, with less work allowed.
    log : callable
        Called with one line of text before each run that is made.

    Returns
    -------
    FinishedReport
        The report.
    """
    runs = TimedRuns(store, log)
    document = Stability(
        machine=Machine.here(),
        criteria=CRITERIA,
        rows=judge_scenes(runs, quick_groups(EXTREME_SCENES) if quick else EXTREME_SCENES),
        pairs=[pair_symmetry(runs, pair) for pair in bound_pairs(quick)],
    )
    figures = {"scenes": stability_figure(document)}
    text = stability_text(document, [f"{name}.png" for name in figures])
    directory = report_directory(store.path, ReportName.STABILITY)
    report = FinishedReport(directory, document, text, stability_conclusions(document))
    write_report(report, figures)
    return report


def judge_scenes(runs: TimedRuns, groups: SceneGroups) -> list[SceneVerdict]:
    """Run every scene to its end and judge it.

    Parameters
    ----------
    runs : TimedRuns
        Makes the runs.
    groups : mapping of str to mapping of str to Scene
        Scenes by name, in named groups.

    Returns
    -------
    list of SceneVerdict
        One for each scene.
    """
    return [
        _verdict(runs, group, name, scene)
        for group, scenes in groups.items()
        for name, scene in scenes.items()
    ]


def quick_groups(groups: SceneGroups) -> dict[str, dict[str, Scene]]:
    """Return the first scene of each group, with less work allowed.

    Parameters
    ----------
    groups : mapping of str to mapping of str to Scene
        Scenes by name, in named groups.

    Returns
    -------
    dict of str to dict of str to Scene
        One scene in each group.
    """
    return {group: dict([_limited(*next(iter(scenes.items())))]) for group, scenes in groups.items()}


def _limited(name: str, scene: Scene) -> tuple[str, Scene]:
    numerics = scene.numerics.model_copy(update={"work_limit": QUICK_WORK_LIMIT})
    return name, scene.model_copy(update={"numerics": numerics})


def _verdict(runs: TimedRuns, group: str, name: str, scene: Scene) -> SceneVerdict:
    try:
        run = runs.run(scene, f"{group}: {name}")
    except Exception as error:  # one scene that breaks the solver must not hide the others
        failure = f"raised {type(error).__name__}: {error}"
        return SceneVerdict(
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
    return SceneVerdict(
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
        global_error=None if run.error.global_ is None else _finite(run.error.global_),
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
    """Return the largest rise of the total energy above an earlier value, over its largest magnitude.

    Parameters
    ----------
    run : Run
        A run with recorded energies.

    Returns
    -------
    float
        0 if the energy never rises, as it must not at rest.
    """
    energy = run.series["bending_energy"] + run.series.get("adhesion_energy", 0.0)
    return float(np.max(energy - np.minimum.accumulate(energy)) / np.max(np.abs(energy)))


def judge(run: Run, rise: float | None) -> tuple[StabilityVerdict, str]:
    """Judge a run by `CRITERIA`.

    Parameters
    ----------
    run : Run
        The run.
    rise : float or None
        Result of `energy_rise`; None if there is a flow.

    Returns
    -------
    verdict : StabilityVerdict
        How far the run can be trusted.
    reason : str
        What the verdict rests on; empty if there is nothing to object to.
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
