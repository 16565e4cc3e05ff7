"""The stability report: verdicts that hold, scenes that reach the extremes, and the command that makes it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ensemble.config.documents import load_scene, load_study
from ensemble.report.stability import make_stability as make_stability_module
from ensemble.report.stability.bound_pairs import UPPER_ENDS, BoundPair, bound_pairs
from ensemble.report.stability.extreme_scenes import EXTREME_SCENES
from ensemble.report.stability.make_stability import (
    energy_rise,
    judge,
    judge_scenes,
    make_stability,
    quick_groups,
)
from ensemble.report.stability.stability_document import Stability, StabilityVerdict
from ensemble.report.timed_runs import TimedRuns
from ensemble.store import Store
from solver.analysis.run import Outcome
from solver.scene import Numerics, Scene, Trap, Vesicle
from solver.simulation.simulate import simulate


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store.open(tmp_path / "store") as opened:
        yield opened


EXTREMES = {name: scene for scenes in EXTREME_SCENES.values() for name, scene in scenes.items()}


@pytest.mark.parametrize("name", EXTREMES)
def test_every_extreme_scene_is_valid_and_limited(name):
    scene = EXTREMES[name]
    assert Scene.model_validate(scene.model_dump()) == scene
    assert scene.numerics.work_limit <= 400_000


def test_the_extreme_scenes_reach_what_they_should():
    assert len(EXTREMES) == sum(map(len, EXTREME_SCENES.values())) >= 40  # no name twice
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


def test_the_bound_pairs_are_those_of_the_default_study_and_twenty_more() -> None:
    pairs = list(bound_pairs(quick=False))
    study = load_study("critical-hamaker")
    assert list(study.sweep[0].values) == list(UPPER_ENDS)
    of_study = [pair.scene for pair in pairs if pair.group == "default study"]
    assert of_study == [study.scene_at((rate,), hamaker) for rate, hamaker in UPPER_ENDS.items()]
    assert len(pairs) == len({pair.name for pair in pairs}) == len(of_study) + 20
    assert len(list(bound_pairs(quick=True))) == 3


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
    rows = judge_scenes(
        TimedRuns(store, lambda line: None), {"group": {"broken": broken, "limited": limited, "good": good}}
    )
    assert [row.verdict for row in rows] == [
        StabilityVerdict.FAILED,
        StabilityVerdict.FAILED,
        StabilityVerdict.FINE,
    ]
    assert rows[0].failure.startswith("raised ")
    assert "work limit" in rows[1].failure
    assert rows[2].smallest_step > 0
    assert rows[2].smallest_step == store.summary(rows[2].run_key).work.smallest_step


def assert_written(directory: Path, document: Stability) -> None:
    """The files of a report are there, and hold it."""
    names = {file.name for file in directory.iterdir()}
    assert names == {"report.md", "report.html", "report.json", "scenes.png", "scenes.svg"}
    assert Stability.model_validate_json((directory / "report.json").read_text()) == document
    assert (directory / "scenes.png").read_bytes().startswith(b"\x89PNG")
    assert all(row.scene in (directory / "report.md").read_text() for row in document.rows)


def test_a_report_is_written_into_the_store_and_resumes(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = Scene(horizon=2.0, vesicles=(Vesicle(),), numerics=Numerics(points=32, tolerance=1e-3))
    in_trap = scene.model_copy(update={"flow": Trap(rate=0.1)})
    groups = {"at rest": {"one vesicle": scene, "not in a quick report": in_trap}, "flow": {"trap": in_trap}}
    doublet = load_scene("doublet-shear", ["adhesion.hamaker=1.0", "numerics.points=32"])
    apart = load_scene("doublet-shear", ["adhesion.hamaker=0.1", "numerics.points=32"])
    pairs = [BoundPair("pairs", "doublet", doublet), BoundPair("pairs", "apart", apart)]
    monkeypatch.setattr(make_stability_module, "EXTREME_SCENES", groups)
    monkeypatch.setattr(make_stability_module, "bound_pairs", lambda quick: iter(pairs))
    lines: list[str] = []
    report = make_stability(store, quick=True, log=lines.append)
    assert lines == ["at rest: one vesicle", "flow: trap", "pairs: doublet", "pairs: apart"]
    bound, separated = report.document.pairs
    assert bound.stable
    assert 0 < bound.growth_factor < 1e-6
    assert separated.stable is None
    assert "separated" in separated.reason
    assert len(report.conclusions) <= 10
    assert report.text.split("\n\n")[1].splitlines() == [f"- {each}" for each in report.conclusions]
    assert "1 of 1 bound pairs" in report.conclusions[-2]
    assert report.directory == store.path / "reports" / "stability"
    assert_written(report.directory, report.document)
    assert make_stability(store, quick=True, log=lines.append).document == report.document
    assert len(lines) == 4


@pytest.mark.long
def test_the_command_writes_a_report_into_the_store_and_resumes(ensemble, tmp_path):
    command = ("report", "stability", "--quick", "--store", str(tmp_path / "store"), "--json")
    first = ensemble(*command)
    assert first.returncode == 0, first.stderr
    document = Stability.model_validate_json(first.stdout)
    quick = quick_groups(EXTREME_SCENES)
    scenes = [name for scenes in quick.values() for name in scenes]
    assert [row.scene for row in document.rows] == scenes
    names = scenes + [pair.name for pair in bound_pairs(quick=True)]
    assert all(pair.stable for pair in document.pairs)
    assert [line.partition(": ")[2] for line in first.stderr.splitlines()] == names
    assert all(row.evaluations <= 3_500 for row in document.rows)
    assert_written(tmp_path / "store" / "reports" / "stability", document)

    for conclusion in ensemble(*command[:-1]).stdout.splitlines()[:-1]:
        assert conclusion in (tmp_path / "store" / "reports" / "stability" / "report.md").read_text()
    again = ensemble(*command)
    assert again.stderr == ""
    assert json.loads(again.stdout) == json.loads(first.stdout)
    assert ensemble("check", "--store", str(tmp_path / "store")).returncode == 0
    with Store.existing(tmp_path / "store") as store:
        assert {run.report for run in store.summaries()} == {"stability"}


def test_bad_input_is_refused(ensemble, tmp_path):
    assert ensemble("report", "weather", cwd=tmp_path).returncode == 2
    file = tmp_path / "file"
    file.write_text("")
    refused = ensemble("report", "stability", "--quick", f"--store={file}", cwd=tmp_path)
    assert refused.returncode == 2
    assert "store" in refused.stderr
    assert list(Path(tmp_path).iterdir()) == [file]
