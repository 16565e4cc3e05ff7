"""Reports: errors that measure shapes, verdicts that hold, and runs that are made once."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ensemble.figures import save
from ensemble.report.envelope import ERRORS, envelopes
from ensemble.report.extremes import GROUPS
from ensemble.report.markdown import work_precision_text
from ensemble.report.measurement import Measurement
from ensemble.report.methods import BDF, FULL, QUICK, ROSENBROCK, Method, Plan
from ensemble.report.report_figures import error_figures
from ensemble.report.runs import Runs
from ensemble.report.scenes import SCENES
from ensemble.report.shape import shape_distance
from ensemble.report.stability import (
    Stability,
    StabilityVerdict,
    energy_rise,
    judge,
    quick_groups,
    stability,
)
from ensemble.report.work_precision import WorkPrecision, slopes, work_precision
from ensemble.store import Store
from solver.analysis.run import Outcome
from solver.membrane import curve
from solver.membrane.shapes import ellipse_tangent_angle
from solver.scene import Numerics, Scene, Trap, Vesicle
from solver.simulation.simulate import simulate

TINY = Plan(
    methods=(BDF,),
    points=(32,),
    tolerances=(1e-1, 1e-4),
    work_limit=5_000,
    reference=(48, 1e-6),
    control=(40, 1e-6),
    answer_points=32,
    answer_tolerances=(1e-3,),
    answer_reference=(40, 1e-5),
    search_tolerances=(1e-3,),
    bracket=0.3,
)
ONE_SCENE = {"vesicle in shear": SCENES["vesicle in shear"]}


def ellipse(points: int, shift: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Points of an ellipse, the first ``shift`` spacings beyond the tip, and the normals there."""
    finely = 256
    alpha = 2 * np.pi * (np.arange(points) + shift) / points
    theta = ellipse_tangent_angle(0.9, 2 * np.pi, 0.3, finely)
    place = curve.positions(theta, np.array([0.2, -0.1]), 2 * np.pi)
    spectrum = np.fft.fft(place[0] + 1j * place[1]) / finely
    wavenumber = np.fft.fftfreq(finely, 1 / finely)
    waves = np.exp(1j * np.outer(alpha, wavenumber))
    at, along = waves @ spectrum, waves @ (1j * wavenumber * spectrum)
    normal = 1j * along / np.abs(along)
    return np.array([at.real, at.imag]), np.array([normal.real, normal.imag])


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    with Store.open(tmp_path_factory.mktemp("report") / "store") as opened:
        yield opened


@pytest.fixture(scope="module")
def report(store: Store) -> WorkPrecision:
    return work_precision(Runs(store, lambda line: None), TINY, ONE_SCENE)


@pytest.mark.parametrize("shift", [0.0, 1.0, 0.37])
def test_a_relabelled_curve_is_the_same_shape(shift):
    other, _ = ellipse(128)
    points, _ = ellipse(128, shift)
    if shift:
        assert np.abs(points - other).max() > 0.01
    assert shape_distance(points, other).max() < 1e-12


@pytest.mark.parametrize("offset", [1e-9, 1e-3, 0.1])
def test_a_curve_offset_along_its_normals_is_that_far_away(offset):
    points, normals = ellipse(48, 0.3)
    other, _ = ellipse(160)
    for side in (-1, 1):
        distances = shape_distance(points + side * offset * normals, other)
        np.testing.assert_allclose(distances, offset, rtol=1e-10, atol=1e-13)


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
    again = work_precision(Runs(store, lines.append), TINY, ONE_SCENE)
    assert lines == []
    assert len(store.summaries()) == before
    assert again == report


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
    figures = error_figures(report)
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
    assert report.machine.processor in text
    for measurement in report.measurements:
        assert f"{measurement.error_rms:.4g}" in text


def test_a_run_that_fails_has_no_error_and_ends_its_series(store):
    scarce = Method("BDF, scarce", {"integrator": "bdf", "work_limit": 200})
    plan = replace(TINY, methods=(BDF, scarce), tolerances=(1e-2, 1e-7, 1e-8))
    measured = work_precision(Runs(store, lambda line: None), plan, ONE_SCENE)
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

    second, fourth = slopes([*series(2.0, 1e-9, "second"), *series(4.0, 1e-9, "fourth")])
    assert (second.fitted, fourth.fitted) == (4, 4)
    assert second.order == pytest.approx(2.0, abs=1e-4)
    assert fourth.order == pytest.approx(4.0, abs=0.02)
    (alone,) = slopes(series(2.0, 1.0, "floor only"))
    assert alone.order is None


def test_the_envelope_is_the_least_time_to_an_error_at_any_resolution(report):
    template = report.measurements[0]

    def measured(method: str, points: int, error: float | None, seconds: float) -> Measurement:
        changed = {"method": method, "points": points, "error_rms": error, "wall_seconds": seconds}
        return template.model_copy(update=changed)

    found = envelopes(
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


EXTREMES = {name: scene for scenes in GROUPS.values() for name, scene in scenes.items()}


@pytest.mark.parametrize("name", EXTREMES)
def test_every_extreme_scene_is_valid_and_limited(name):
    scene = EXTREMES[name]
    assert Scene.model_validate(scene.model_dump()) == scene
    assert scene.numerics.work_limit <= 400_000


def test_the_extreme_scenes_reach_what_they_should():
    assert len(EXTREMES) == sum(map(len, GROUPS.values())) >= 40  # no name twice
    scenes = EXTREMES.values()
    adhesions = [scene.adhesion for scene in scenes if scene.adhesion]
    vesicles = [vesicle for scene in scenes for vesicle in scene.vesicles]
    assert {(12, 6), (24, 12)} <= {adhesion.exponents for adhesion in adhesions}
    assert min(adhesion.distance for adhesion in adhesions) == 0.01
    assert max(adhesion.hamaker for adhesion in adhesions) == 1e3
    assert {0.3, 0.999, 1.0} <= {vesicle.reduced_area for vesicle in vesicles}
    assert {1e-4, 1e2} <= {vesicle.bending_modulus for vesicle in vesicles}
    assert {1e-2, 10.0, 1e3} <= {vesicle.viscosity_contrast for vesicle in vesicles}
    assert any(adhesion.cutoff for adhesion in adhesions)
    assert {1e-3, 1e2} <= {scene.flow.rate for scene in scenes if scene.flow}
    assert {16, 512} <= {scene.numerics.points for scene in scenes}
    assert max(scene.horizon for scene in scenes) == 1e4
    assert any(len({vesicle.length for vesicle in scene.vesicles}) == 2 for scene in scenes)


def test_verdicts_follow_the_criteria():
    pair = EXTREMES["start at a quarter of the adhesion distance, at rest"]
    coarse = Numerics(points=48, tolerance=1e-3)
    run = simulate(pair.model_copy(update={"horizon": 2.0, "numerics": coarse}))
    rise = energy_rise(run)
    assert judge(run, rise) == (StabilityVerdict.FINE, "")

    def with_errors(**errors: float):
        return replace(run, error=replace(run.error, **errors))

    assert judge(with_errors(spatial=2e-3), rise)[0] is StabilityVerdict.SPACE
    assert judge(with_errors(spatial=float("nan")), rise)[0] is StabilityVerdict.SPACE
    assert judge(with_errors(area=2e-2), rise)[0] is StabilityVerdict.TIME
    assert judge(with_errors(closure=2e-2), rise)[0] is StabilityVerdict.TIME
    assert judge(run, 2e-3)[0] is StabilityVerdict.TIME
    failed = replace(run, outcome=Outcome.FAILED, failure="no step is small enough")
    assert judge(failed, rise) == (StabilityVerdict.FAILED, "no step is small enough")


def test_the_energy_rise_is_the_largest_above_any_earlier_value():
    fine = Numerics(points=64, tolerance=1e-7)
    run = simulate(Scene(horizon=1.0, vesicles=(Vesicle(),), numerics=fine))
    assert energy_rise(run) < 1e-6
    climbing = replace(run, series={**run.series, "bending_energy": np.array([10.0, 6.0, 8.0, 5.0, 6.5])})
    assert energy_rise(climbing) == pytest.approx(0.2)


def test_a_scene_that_raises_does_not_hide_the_others(store):
    good = Scene(horizon=1.0, vesicles=(Vesicle(),), numerics=Numerics(points=48))
    broken = good.model_copy(update={"vesicles": ()})
    limited = good.model_copy(update={"flow": Trap(rate=0.1), "numerics": Numerics(points=32, work_limit=5)})
    rows = stability(
        Runs(store, lambda line: None), {"group": {"broken": broken, "limited": limited, "good": good}}
    ).rows
    assert [row.verdict for row in rows] == [
        StabilityVerdict.FAILED,
        StabilityVerdict.FAILED,
        StabilityVerdict.FINE,
    ]
    assert rows[0].failure.startswith("raised ")
    assert "work limit" in rows[1].failure
    assert rows[2].smallest_step > 0
    assert rows[2].smallest_step == store.summary(rows[2].run_key).work.smallest_step


def test_the_command_writes_a_report_into_the_store_and_resumes(ensemble, tmp_path):
    command = ("report", "stability", "--quick", "--store", str(tmp_path / "store"), "--json")
    first = ensemble(*command)
    assert first.returncode == 0, first.stderr
    document = Stability.model_validate_json(first.stdout)
    quick = quick_groups(GROUPS)
    names = [name for scenes in quick.values() for name in scenes]
    assert [row.scene for row in document.rows] == names
    assert [line.partition(": ")[2] for line in first.stderr.splitlines()] == names
    assert all(row.evaluations <= 3_500 for row in document.rows)

    directory = tmp_path / "store" / "reports" / "stability"
    assert {file.name for file in directory.iterdir()} == {
        "report.md",
        "report.json",
        "scenes.png",
        "scenes.svg",
    }
    assert Stability.model_validate_json((directory / "report.json").read_text()) == document
    assert (directory / "scenes.png").read_bytes().startswith(b"\x89PNG")
    assert all(name in (directory / "report.md").read_text() for name in names)

    again = ensemble(*command)
    assert again.stderr == ""
    assert json.loads(again.stdout) == json.loads(first.stdout)
    assert ensemble("check", "--store", str(tmp_path / "store")).returncode == 0


def test_bad_input_is_refused(ensemble, tmp_path):
    assert ensemble("report", "weather", cwd=tmp_path).returncode == 2
    file = tmp_path / "file"
    file.write_text("")
    refused = ensemble("report", "stability", "--quick", f"--store={file}", cwd=tmp_path)
    assert refused.returncode == 2
    assert "store" in refused.stderr
    assert list(Path(tmp_path).iterdir()) == [file]
