"""The paper's report: what it compares, the commands that it states, and how it is made on all ranks."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

from ensemble.config.documents import load_scene, load_study
from ensemble.config.run_key import run_key
from ensemble.report.paper.case import Case, StudyCase
from ensemble.report.paper.comparison import compare_intervals, compare_numbers, compare_words, runs_of
from ensemble.report.paper.least_squares import power_law
from ensemble.report.paper.paper_document import Paper, PaperSection, ReportFigure
from ensemble.report.paper.paper_text import paper_text
from ensemble.report.paper.sections import SECTIONS, sections_named
from ensemble.report.report_model import Machine
from ensemble.store import Store
from solver.analysis.run import Outcome

CASE = Case.of("doublet-shear", {"adhesion.hamaker": 0.1, "vesicles.1.center": [1.75, 0.0]})


def test_a_case_is_the_scene_that_its_command_runs() -> None:
    ensemble, run, preset, *options = shlex.split(CASE.command)
    assert (ensemble, run) == ("ensemble", "run")
    assert set(options[::2]) == {"--set"}
    assert run_key(load_scene(preset, options[1::2])) == CASE.key
    assert CASE.scene.adhesion.hamaker == 0.1
    assert CASE.scene.vesicles[1].center == (1.75, 0.0)
    assert CASE.with_changes({"adhesion.hamaker": 0.2}).scene.adhesion.hamaker == 0.2


def test_a_study_is_the_one_that_its_command_traces() -> None:
    case = StudyCase.of("critical-hamaker", {"sweep.values": [0.5, 1.0], "search.tolerance": 0.05})
    _, verb, preset, *options = shlex.split(case.command)
    assert verb == "bisect"
    assert load_study(preset, options[1::2]).key == case.study.key


@pytest.mark.parametrize(
    ("computed", "deviation", "agrees"),
    [
        ((0.34, 0.36), 0.0, True),
        ((0.39, 0.41), 0.0, True),
        ((0.408, 0.41), 2.0, True),
        ((0.44, 0.45), 10.0, False),
        ((0.2, 0.27), -10.0, False),
    ],
)
def test_brackets_agree_where_they_overlap_or_nearly_touch(computed, deviation, agrees) -> None:
    row = compare_intervals("critical value", (0.3, 0.4), computed, allowed=3)
    assert row.deviation == pytest.approx(deviation, abs=1e-9)
    assert row.agrees is agrees


def test_numbers_deviate_relatively_or_in_their_unit() -> None:
    relative = compare_numbers("period", 40.0, 40.6, runs_of(CASE), allowed=1)
    assert relative.deviation == pytest.approx(1.5)
    assert relative.agrees is False
    assert relative.runs == [CASE.key]
    degrees = compare_numbers("angle", 130.0, 128.5, allowed=2, unit="°")
    assert degrees.deviation == pytest.approx(-1.5)
    assert degrees.agrees is True
    new = compare_numbers("beyond the paper", None, 3.0)
    assert (new.deviation, new.agrees) == (None, None)
    assert compare_words("outcome", "bound", "separated").agrees is False
    assert compare_words("outcome", "bound", "bound").agrees is True


def test_a_power_law_is_found_with_its_uncertainty() -> None:
    x = np.array([0.1, 0.2, 0.3, 0.5])
    exact = power_law(x, 3 * x**-2)
    assert (exact.prefactor, exact.exponent) == pytest.approx((3, -2))
    assert exact.error < 1e-10
    # Two 95% intervals of a line through three points: the one free value has t = 12.7 (tables).
    disturbed = power_law([1, np.e, np.e**2], np.exp([0.0, 1.3, 2.0]))
    assert disturbed.exponent == pytest.approx(1.0)
    assert disturbed.error == pytest.approx(12.7062 * 0.3 / np.sqrt(3), rel=1e-4)
    with pytest.raises(ValueError, match="at least 3"):
        power_law([1, 2], [1, 2])


def test_the_text_has_every_row_with_its_sources() -> None:
    rows = [
        compare_numbers("period, γ̇ = 0.5", 36.34, 36.22, runs_of(CASE), allowed=1),
        compare_intervals("H_c", (0.3, 0.4), (0.5, 0.51), allowed=3, note="a|b"),
    ]
    command = "ensemble report paper --only shear"
    figure = ReportFigure(name="shear-period", caption="Period.", command=command)
    part = PaperSection(name="shear", title="Shear", content=["What *one* sees.", rows, figure])
    paper = Paper(quick=False, machine=Machine.here(), ranks=2, runs=3, wall_seconds=1.0, parts=[part])
    text = paper_text(paper)
    first, second, _ = text.split("\n\n")[1].splitlines()
    assert first == "- 1 of 2 values agree with the published ones within the allowed deviation."
    assert second == "- The others are in: Shear."
    assert "| period, γ̇ = 0.5 | 36.34 | 36.22 | -0.33 % ✓ | ± 1 % |  |" in text
    assert "| 0.3 to 0.4 | 0.5 to 0.51 | +25.00 % ✗ | ± 3 % | a\\|b |" in text
    assert CASE.key[:8] in text
    assert "(shear-period.png)" in text
    assert "ensemble report paper --only shear" in text
    assert "<summary>Runs and commands</summary>" in text


def test_sections_are_chosen_by_name(ensemble, tmp_path) -> None:
    names = [section.name for section in SECTIONS]
    assert len(set(names)) == len(names)
    assert sections_named([]) == SECTIONS
    assert sections_named([names[-1]]) == SECTIONS[-1:]
    refused = ensemble("report", "paper", "--only", "shere", "--store", str(tmp_path / "store"))
    assert refused.returncode == 2
    assert all(name in refused.stderr for name in ["--only", "shere", *names])
    assert not (tmp_path / "store").exists()
    other = ensemble("report", "stability", "--only", names[0], "--store", str(tmp_path / "store"))
    assert other.returncode == 2


MAKING = """
import json, sys
from pathlib import Path
from matplotlib.figure import Figure
from ensemble.mpi.world import abort_guard, world
from ensemble.report.paper.case import Case, StudyCase
from ensemble.report.paper.make_paper import make_paper
from ensemble.report.paper.comparison import compare_numbers, compare_words, runs_of, study_runs
from ensemble.report.paper.section import Section, SectionContent, SectionFigure, SectionPlan
from ensemble.mpi.store_on_ranks import store_on_ranks

def case(rate, limit=10000):
    numerics = {"numerics.points": 32, "numerics.tolerance": 1e-3, "numerics.work_limit": limit}
    return Case.of("vesicle-shear", {"flow.rate": rate} | numerics)

def inclination(quick):
    first = case(0.5)
    results = yield SectionPlan([first, case(0.9, 20)])
    steady = results.summary(first)
    then = case(0.25 if results.failed(case(0.9, 20)) else 1.0)
    results = yield SectionPlan([then])
    return SectionContent([
        "Text.",
        [compare_numbers("inclination", 32.0, steady.inclination_angle, runs_of(first), allowed=2, unit="°"),
         compare_numbers("then", None, results.run(then).series["inclination_angle"][-1], runs_of(then))],
        SectionFigure("empty", "Nothing.", Figure()),
    ])

def boundary(quick):
    study = StudyCase.of("critical-hamaker", {
        "sweep.values": [0.5], "search.tolerance": 0.5, "search.limits": [0.2, 0.5],
        "scene.numerics.points": 32, "scene.numerics.tolerance": 1e-3,
    })
    results = yield SectionPlan([case(0.5)], [study])
    status = results.points(study)[0.5].status
    return SectionContent([[compare_words("boundary", "converged", status, study_runs(study))]])

sections = [Section("a", "A", inclination), Section("b", "B", boundary)]
communicator = world()
with abort_guard(communicator):
    with store_on_ranks(communicator, Path(sys.argv[1])) as store:
        report = make_paper(communicator, store, sections, True, lambda line: None)
    assert (report is None) == (communicator.Get_rank() != 0)
"""


@pytest.fixture(scope="module")
def made(launcher, tmp_path_factory) -> tuple[Path, list[dict]]:
    """The store of a report that was made on two ranks and again on one, and its data each time."""
    store = tmp_path_factory.mktemp("paper") / "store"
    documents = []
    for ranks in (2, 1):
        result = launcher.run(ranks, [sys.executable, "-c", MAKING, str(store)])
        assert result.returncode == 0, result.stderr
        documents.append(json.loads((store / "reports" / "paper" / "report.json").read_text()))
    return store, documents


def test_sections_get_what_they_ask_for_and_may_ask_again(made) -> None:
    store, (document, _) = made
    a, b = document["parts"]
    text, (inclination, then), figure = a["content"]
    assert text == "Text."
    assert inclination["agrees"] is True
    assert b["content"][0][0]["computed"] == "converged"
    assert figure["command"] == "ensemble report paper --only a"
    with Store.existing(store) as opened:
        assert opened.summary(inclination["runs"][0]).inclination_angle == inclination["computed"]
        assert opened.summary(then["runs"][0]).scene.flow.rate == 0.25, "a failed run is a result"
        assert Outcome.FAILED in {summary.outcome for summary in opened.summaries()}


def test_a_report_is_made_of_whole_files_and_resumes(made) -> None:
    store, (document, again) = made
    names = {path.name for path in (store / "reports" / "paper").iterdir()}
    assert names == {"report.md", "report.html", "report.json", "a-empty.png", "a-empty.svg"}
    assert document["runs"] >= 5
    assert again["runs"] == 0
    assert again["parts"] == document["parts"]
