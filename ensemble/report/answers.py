"""Error against run time of what users ask for: period, intrinsic viscosity and critical adhesion."""

from __future__ import annotations

from ensemble.config.documents import load_scene, load_study
from ensemble.config.run_key import run_key
from ensemble.report.methods import Method, Plan
from ensemble.report.report_model import Document
from ensemble.report.runs import Runs
from ensemble.search.study_search import critical_value_search, expected_bracket, side_of
from solver.analysis.run import Outcome
from solver.scene import Scene

SCENE = "doublet-shear"  # presets
STUDY = "critical-hamaker"
SHEAR_RATE = 0.5


class Answer(Document):
    """Period and intrinsic viscosity from one run, with their relative errors; None if the run failed."""

    method: str
    points: int
    tolerance: float
    period: float | None
    viscosity: float | None
    period_error: float | None
    viscosity_error: float | None
    wall_seconds: float
    evaluations: int
    failure: str | None
    run_key: str


class Critical(Document):
    """A bracket of the critical adhesion strength from runs of one tolerance, and the time of all of them."""

    tolerance: float
    bracket: tuple[float | None, float | None]
    status: str
    runs: int
    run_keys: list[str]
    wall_seconds: float


def answers(runs: Runs, plan: Plan) -> list[Answer]:
    """Compare every method's period and viscosity of the doublet in shear with those of a converged run.

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
    found: list[Answer] = []
    for method in plan.methods:
        for tolerance in plan.answer_tolerances:
            scene = _doublet(plan, method, plan.answer_points, tolerance)
            run = runs.summary(scene, f"period: {method.name}, tolerance {tolerance:g}")
            viscosity = None if run.viscosity is None else run.viscosity.total
            found.append(
                Answer(
                    method=method.name,
                    points=plan.answer_points,
                    tolerance=tolerance,
                    period=run.period,
                    viscosity=viscosity,
                    period_error=_relative(run.period, converged.period),
                    viscosity_error=_relative(viscosity, converged.viscosity.total),
                    wall_seconds=run.wall_seconds,
                    evaluations=run.work.rhs_evaluations,
                    failure=run.failure,
                    run_key=run_key(scene),
                )
            )
            if run.outcome is Outcome.FAILED:
                break
    return found


def critical_values(runs: Runs, plan: Plan) -> list[Critical]:
    """Bracket the critical adhesion strength once for each of the plan's tolerances."""
    return [_critical(runs, plan, tolerance) for tolerance in plan.search_tolerances]


def _doublet(plan: Plan, method: Method, points: int, tolerance: float) -> Scene:
    numerics = method.at(points, tolerance, plan.work_limit)
    return load_scene(SCENE).model_copy(update={"numerics": numerics})


def _relative(value: float | None, converged: float) -> float | None:
    return None if value is None else abs(value / converged - 1)


def _critical(runs: Runs, plan: Plan, tolerance: float) -> Critical:
    study = load_study(
        STUDY,
        [
            f"sweep.values=[{SHEAR_RATE}]",
            f"search.tolerance={plan.bracket!r}",
            f"scene.numerics.tolerance={tolerance!r}",
        ],
    )
    search = critical_value_search(study, expected_bracket(study, SHEAR_RATE, {}))
    keys, seconds = [], 0.0
    while (value := search.ask()) is not None:
        scene = study.scene_at(SHEAR_RATE, value)
        run = runs.summary(scene, f"critical adhesion: tolerance {tolerance:g}, H = {value:.5g}")
        search.tell(value, side_of(study, run.outcome))
        keys.append(run.key)
        seconds += run.wall_seconds
    return Critical(
        tolerance=tolerance,
        bracket=search.bracket,
        status=search.status,
        runs=len(keys),
        run_keys=keys,
        wall_seconds=seconds,
    )
