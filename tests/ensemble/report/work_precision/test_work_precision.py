"""The work-precision report: errors, observed orders and least times, and runs that are made once."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from ensemble.figures import save
from ensemble.report.timed_runs import TimedRuns
from ensemble.report.work_precision.least_times import ERRORS, least_times
from ensemble.report.work_precision.make_work_precision import measure_work_precision
from ensemble.report.work_precision.observed_orders import observed_orders
from ensemble.report.work_precision.short_scenes import SHORT_SCENES
from ensemble.report.work_precision.work_precision_conclusions import work_precision_conclusions
from ensemble.report.work_precision.work_precision_document import Measurement, WorkPrecision
from ensemble.report.work_precision.work_precision_figures import work_precision_figures
from ensemble.report.work_precision.work_precision_plan import (
    BDF,
    FULL,
    QUICK,
    ROSENBROCK,
    ComparedMethod,
    WorkPrecisionPlan,
)
from ensemble.report.work_precision.work_precision_text import work_precision_text
from ensemble.store import Store

TINY = WorkPrecisionPlan(
    methods=(BDF,),
    points=(32,),
    tolerances=(1e-2, 1e-5),
    work_limit=5_000,
    reference=(48, 1e-6),
    control=(40, 1e-6),
    answer_points=32,
    answer_tolerances=(1e-3,),
    answer_reference=(40, 1e-5),
    search_tolerances=(1e-3,),
    bracket=0.3,
)
ONE_SCENE = {"vesicle in shear": SHORT_SCENES["vesicle in shear"]}


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    with Store.open(tmp_path_factory.mktemp("report") / "store") as opened:
        yield opened


@pytest.fixture(scope="module")
def report(store: Store) -> WorkPrecision:
    return measure_work_precision(TimedRuns(store, lambda line: None), TINY, ONE_SCENE)


def test_the_error_falls_with_the_tolerance(report):
    loose, tight = report.measurements
    assert (loose.tolerance, tight.tolerance) == TINY.tolerances
    assert tight.error_rms < 0.1 * loose.error_rms
    assert tight.error_rms <= tight.error_max
    assert tight.evaluations > loose.evaluations
    assert report.references[0].uncertainty < tight.error_max


def test_the_answers_are_those_of_the_runs(report, store):
    (answer,) = report.answers
    run = store.summary(answer.run_key)
    assert (answer.period, answer.viscosity) == (run.period, run.viscosity.total)
    assert 36.0 < answer.period < 36.5
    assert 0 < answer.period_error < 0.01


def test_the_critical_value_is_bracketed(report, store):
    (critical,) = report.critical_values
    low, high = critical.bracket
    assert critical.status == "converged"
    assert low < 0.365 < high < 1.31 * low
    assert critical.runs == len(critical.run_keys) >= 2
    runs = [store.summary(key) for key in critical.run_keys]
    assert {run.scene.numerics.tolerance for run in runs} == {1e-3}
    assert critical.wall_seconds == pytest.approx(sum(run.wall_seconds for run in runs))


def test_a_report_resumes_without_running_anything_again(report, store):
    before = len(store.summaries())
    lines: list[str] = []
    again = measure_work_precision(TimedRuns(store, lines.append), TINY, ONE_SCENE)
    assert lines == []
    assert len(store.summaries()) == before
    assert again == report


def test_the_reported_error_is_that_of_the_run_and_agrees_with_the_true_one(report, store):
    tight = report.measurements[-1]
    assert tight.error_reported == store.summary(tight.run_key).error.global_
    (answer,) = report.answers
    run = store.summary(answer.run_key)
    assert answer.period_reported == run.error.period / run.period
    assert answer.period_error < 3 * answer.period_reported


def test_the_conclusions_say_which_numerics_reach_an_error_in_what_time(report):
    row = report.envelopes[0].model_copy(
        update={"error": 1e-3, "default": "BDF", "fastest": "BDF", "default_seconds": 0.5, "slowdown": 1.0}
    )
    measured = report.measurements[-1].model_copy(
        update={"scene": row.scene, "wall_seconds": 0.5, "tolerance": 1e-4, "points": 48}
    )
    made_up = report.model_copy(
        update={
            "envelopes": [row, row.model_copy(update={"error": 1e-7, "slowdown": 1.5, "fastest": "Euler"})],
            "measurements": [measured],
        }
    )
    overall, at_one_error, *_ = work_precision_conclusions(made_up)
    assert "fastest at 1 of 2 errors" in overall
    assert "1.5 times" in overall
    assert "Euler" in overall
    assert at_one_error == (
        f"{row.scene}, error 0.001: BDF, the default, 0.5 s with tolerance 0.0001 and 48 points; the fastest."
    )


def test_the_document_survives_json(report):
    document = json.loads(report.model_dump_json())
    assert document.keys() == {
        "report",
        "machine",
        "envelopes",
        "references",
        "measurements",
        "slopes",
        "answers",
        "critical_values",
    }
    assert WorkPrecision.model_validate(document) == report


def test_the_report_is_drawn_and_written(report, tmp_path):
    figures = work_precision_figures(report)
    assert figures.keys() == {"error-against-time", "error-against-evaluations", "answers"}
    for name, figure in figures.items():
        save(figure, tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    panel = figures["error-against-evaluations"].axes[0]
    drawn = {line.get_label(): line for line in panel.get_lines()}
    np.testing.assert_array_equal(
        drawn["BDF, N = 32"].get_xydata(), [(m.evaluations, m.error_rms) for m in report.measurements]
    )
    text = work_precision_text(report, ["errors.png"])
    assert "![errors.png](errors.png)" in text
    conclusions = work_precision_conclusions(report)
    assert len(conclusions) <= 10
    assert text.split("\n\n")[1].splitlines() == [f"- {conclusion}" for conclusion in conclusions]
    assert report.machine.processor in text
    for measurement in report.measurements:
        assert f"{measurement.error_rms:.4g}" in text


def test_a_run_that_fails_has_no_error_and_ends_its_series(store):
    scarce = ComparedMethod("BDF, scarce", {"integrator": "bdf", "work_limit": 200})
    plan = replace(TINY, methods=(BDF, scarce), tolerances=(1e-2, 1e-7, 1e-8))
    measured = measure_work_precision(TimedRuns(store, lambda line: None), plan, ONE_SCENE)
    series = [point for point in measured.measurements if point.method == "BDF, scarce"]
    assert [point.tolerance for point in series] == [1e-2, 1e-7]
    assert series[0].error_rms is not None
    assert series[1].error_rms is None
    assert "work limit" in series[1].failure
    assert measured.answers[-1].period is None
    assert measured.answers[-1].period_error is None


def test_observed_orders_leave_out_the_floor(report):
    template = report.measurements[0]

    def series(order: float, floor: float, method: str) -> list[Measurement]:
        return [
            template.model_copy(
                update={"method": method, "evaluations": work, "error_rms": work**-order + floor}
            )
            for work in (10, 20, 40, 80, 10_000_000)
        ]

    second, fourth = observed_orders([*series(2.0, 1e-9, "second"), *series(4.0, 1e-9, "fourth")])
    assert (second.fitted, fourth.fitted) == (4, 4)
    assert second.order == pytest.approx(2.0, abs=1e-4)
    assert fourth.order == pytest.approx(4.0, abs=0.02)
    (alone,) = observed_orders(series(2.0, 1.0, "floor only"))
    assert alone.order is None


def test_the_envelope_is_the_least_time_to_an_error_at_any_resolution(report):
    template = report.measurements[0]

    def measured(method: str, points: int, error: float | None, seconds: float) -> Measurement:
        changed = {"method": method, "points": points, "error_rms": error, "wall_seconds": seconds}
        return template.model_copy(update=changed)

    found = least_times(
        ONE_SCENE,
        [
            measured(ROSENBROCK.name, 32, 5e-3, 0.2),
            measured(ROSENBROCK.name, 64, 8e-5, 0.3),
            measured(ROSENBROCK.name, 64, None, 0.01),
            measured(BDF.name, 32, 2e-4, 0.1),
            measured("SDC, order 2", 32, 9e-4, 1.5),
            template.model_copy(update={"scene": "another", "error_rms": 1e-9, "wall_seconds": 1e-3}),
        ],
    )
    assert [row.error for row in found] == list(ERRORS)
    assert {row.default for row in found} == {ROSENBROCK.name}
    coarse, middle, fine, *finer = found
    assert (coarse.fastest, coarse.fastest_seconds, coarse.default_seconds) == (BDF.name, 0.1, 0.2)
    assert coarse.slowdown == pytest.approx(2.0)
    assert middle.slowdown == pytest.approx(3.0)
    assert middle.speedup == pytest.approx(5.0)
    assert (fine.fastest, fine.slowdown, fine.speedup) == (ROSENBROCK.name, 1.0, None)
    assert all(row.fastest is row.default_seconds is row.slowdown is None for row in finer)


@pytest.mark.parametrize("plan", [QUICK, FULL])
def test_every_resolution_of_the_plans_is_valid(plan):
    for method in plan.methods:
        for points in (*plan.points, plan.answer_points):
            for tolerance in (*plan.tolerances, *plan.answer_tolerances):
                method.at(points, tolerance, plan.work_limit)
        for points, tolerance in (plan.reference, plan.control, plan.answer_reference):
            method.at(points, tolerance, plan.work_limit)
