"""Errors of what users ask for: period, intrinsic viscosity and critical Hamaker constant of a doublet."""

from __future__ import annotations

from ensemble.config.documents import load_scene, load_study
from ensemble.config.run_key import run_key
from ensemble.report.timed_runs import TimedRuns
from ensemble.report.work_precision.work_precision_document import CriticalBracket, DoubletAnswer
from ensemble.report.work_precision.work_precision_plan import ComparedMethod, WorkPrecisionPlan
from ensemble.search.known_brackets import expected_bracket
from ensemble.search.study_search import critical_value_search, side_of
from solver.analysis.run import Outcome
from solver.scene import Scene

_SCENE = "doublet-shear"  # presets
_STUDY = "critical-hamaker"
SHEAR_RATE = 0.5


def doublet_answers(runs: TimedRuns, plan: WorkPrecisionPlan) -> list[DoubletAnswer]:
    """Compare period and viscosity of the doublet in shear, by every method, with those of a converged run.

    Parameters
    ----------
    runs : TimedRuns
        Makes the runs.
    plan : WorkPrecisionPlan
        Methods, points and tolerances.

    Returns
    -------
    list of DoubletAnswer
        One for each run; the series of a method ends with the first run that fails.

    Raises
    ------
    ArithmeticError
        If the converged run has no period.
    """
    points, tolerance = plan.answer_reference
    converged = runs.summary(
        _doublet(plan, plan.methods[0], points, tolerance),
        f"period: converged run, N = {points}, tolerance {tolerance:g}",
    )
    if converged.period is None or converged.viscosity is None:
        raise ArithmeticError(f"period: the converged run is {converged.outcome}: {converged.failure}")
    answers: list[DoubletAnswer] = []
    for method in plan.methods:
        for tolerance in plan.answer_tolerances:
            scene = _doublet(plan, method, plan.answer_points, tolerance)
            run = runs.summary(scene, f"period: {method.name}, tolerance {tolerance:g}")
            viscosity = None if run.viscosity is None else run.viscosity.total
            answers.append(
                DoubletAnswer(
                    method=method.name,
                    points=plan.answer_points,
                    tolerance=tolerance,
                    period=run.period,
                    viscosity=viscosity,
                    period_error=_relative_error(run.period, converged.period),
                    viscosity_error=_relative_error(viscosity, converged.viscosity.total),
                    period_reported=_relative_size(run.error.period, run.period),
                    viscosity_reported=_relative_size(run.error.viscosity, viscosity),
                    wall_seconds=run.wall_seconds,
                    evaluations=run.work.rhs_evaluations,
                    failure=run.failure,
                    run_key=run_key(scene),
                )
            )
            if run.outcome is Outcome.FAILED:
                break
    return answers


def critical_brackets(runs: TimedRuns, plan: WorkPrecisionPlan) -> list[CriticalBracket]:
    """Bracket the critical Hamaker constant at shear rate 0.5 once for each tolerance of a plan.

    Parameters
    ----------
    runs : TimedRuns
        Makes the runs.
    plan : WorkPrecisionPlan
        Tolerances, and the width of the brackets.

    Returns
    -------
    list of CriticalBracket
        One for each tolerance.
    """
    return [_critical_bracket(runs, plan, tolerance) for tolerance in plan.search_tolerances]


def _doublet(plan: WorkPrecisionPlan, method: ComparedMethod, points: int, tolerance: float) -> Scene:
    numerics = method.at(points, tolerance, plan.work_limit)
    return load_scene(_SCENE).model_copy(update={"numerics": numerics})


def _relative_error(value: float | None, converged: float) -> float | None:
    return None if value is None else abs(value / converged - 1)


def _relative_size(error: float | None, value: float | None) -> float | None:
    return None if error is None or value is None else error / abs(value)


def _critical_bracket(runs: TimedRuns, plan: WorkPrecisionPlan, tolerance: float) -> CriticalBracket:
    study = load_study(
        _STUDY,
        [
            f"sweep.values=[{SHEAR_RATE}]",
            f"search.tolerance={plan.bracket!r}",
            "search.scan=0",
            f"scene.numerics.tolerance={tolerance!r}",
        ],
    )
    search = critical_value_search(study, expected_bracket(study, (SHEAR_RATE,), {}))
    keys, seconds = [], 0.0
    while (value := search.ask()) is not None:
        scene = study.scene_at((SHEAR_RATE,), value)
        run = runs.summary(scene, f"critical adhesion: tolerance {tolerance:g}, H = {value:.5g}")
        search.tell(value, side_of(study, run.outcome))
        keys.append(run.key)
        seconds += run.wall_seconds
    return CriticalBracket(
        tolerance=tolerance,
        bracket=search.bracket,
        status=search.status,
        runs=len(keys),
        run_keys=keys,
        wall_seconds=seconds,
    )
