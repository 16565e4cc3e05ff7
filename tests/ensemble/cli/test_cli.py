"""The command line, as the contract that scripts rely on."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import h5py
import pytest

from ensemble.config.documents import load_scene, load_study, preset_names
from ensemble.config.run_key import run_key
from ensemble.questions import INCOMPLETE_STATUS
from tests.ensemble.group_files import unpacked

QUICK_SCENE = ("doublet-shear", "--set=numerics.points=32", "--set=numerics.tolerance=1e-3")
# Standard output of one JSON document, null where the scene has no such quantity.
INDICATORS = {"area", "closure", "temporal", "spatial"}
ERRORS = INDICATORS | {"global", "period", "inclination_angle", "viscosity", "time"}
RUN_FIELDS = {
    "outcome",
    "configuration",
    "arrangement",
    "failure",
    "undecided",
    "time",
    "perturbations",
    "sensitive",
    "period",
    "settled",
    "effective_aspect_ratio",
    "inclination_angle",
    "gap",
    "viscosity",
    "energy",
    "error",
    "points",
    "steps",
    "rejected_steps",
    "rhs_evaluations",
    "wall_seconds",
    "run_key",
    "results_revision",
}
POINT_FIELDS = {
    "parameters",
    "critical_value",
    "bracket",
    "outcomes",
    "status",
    "changes",
    "incidental_changes",
    "scanned",
    "confirmed",
    "certified",
    "certified_by",
    "runs",
}

REFUSED = {
    "unknown key": (["run", "doublet-shear", "--set=nonsense=1"], "nonsense"),
    "mistyped key": (["run", "doublet-shear", "--set=flow.rte=1"], "did you mean 'rate'?"),
    "mistyped preset": (["bisect", "critical-hamker"], "did you mean 'critical-hamaker'?"),
    "reduced area 0": (["run", "doublet-shear", "--set=vesicles.reduced_area=0"], "vesicles.0.reduced_area"),
    "reduced area 1.2": (
        ["bisect", "--set=scene.vesicles.reduced_area=1.2"],
        "scene.vesicles.0.reduced_area",
    ),
    "not a number": (["run", "doublet-shear", "--set=flow.rate=nan"], "flow.rate"),
    "m not above n": (["run", "doublet-shear", "--set=adhesion.exponents=[2, 4]"], "exponents"),
    "overlapping vesicles": (
        ["run", "doublet-shear", "--set=vesicles.0.center=[1.4, 0.0]"],
        "vesicles 0 and 1 overlap",
    ),
    "odd number of points": (["run", "doublet-shear", "--set=numerics.points=7"], "numerics.points"),
    "negative tolerance": (["bisect", "--tolerance=-0.1"], "search.tolerance"),
    "unknown preset": (["bisect", "no-such-study"], "no-such-study"),
    "unknown scene": (["run", "no-such-scene"], "no-such-scene"),
    "malformed change": (["run", "doublet-shear", "--set=flow.rate"], "flow.rate"),
    "scene for a study": (["bisect", "doublet-shear"], "this is a scene: use ensemble run"),
    "study for a scene": (["run", "critical-hamaker"], "this is a study: use ensemble bisect"),
}


def assert_refused(result, field, directory):
    assert result.returncode == 2
    assert result.stdout == ""
    assert len(result.stderr.strip().splitlines()) == 1, result.stderr
    assert field in result.stderr
    assert list(directory.iterdir()) == [], "something was written"


@pytest.mark.parametrize("case", REFUSED)
def test_bad_input_is_refused_before_any_work(ensemble, tmp_path, case):
    arguments, field = REFUSED[case]
    assert_refused(ensemble(*arguments, "--store=store", cwd=tmp_path), field, tmp_path)


def test_a_store_that_is_a_file_is_refused_and_kept(ensemble, tmp_path):
    place = tmp_path / "store"
    place.write_text("precious")
    for command in (["bisect"], [*("run", "doublet-shear")], ["query", "runs"], ["check"]):
        result = ensemble(*command, f"--store={place}")
        assert result.returncode == 2
        assert len(result.stderr.strip().splitlines()) == 1
        assert str(place) in result.stderr
    assert place.read_text() == "precious"


def test_a_launcher_of_another_mpi_is_noticed(ensemble, tmp_path):
    result = ensemble("bisect", "--store=store", cwd=tmp_path, environment={"PMI_SIZE": "2"})
    assert_refused(result, "launcher", tmp_path)


@pytest.mark.parametrize(
    "arguments",
    [
        ["bisect", "no-such-study"],
        ["bisect", "--tolerance=-1"],
        ["bisect", "--no-such-option"],
        ["run", "no-such-study"],
        ["query", "runs", "--store=no-such-study"],
    ],
)
def test_under_a_launcher_only_rank_0_speaks(launcher, tmp_path, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    result = launcher.run(2, [sys.executable, "-m", "ensemble", *arguments])
    assert result.returncode == 2
    assert result.stdout == ""
    message = [line for line in result.stderr.splitlines() if "no-such" in line or "tolerance" in line]
    assert len(message) == 1, result.stderr
    assert "Traceback" not in result.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def stored_run(ensemble, tmp_path_factory):
    """A run kept in a store: the store and the document."""
    store = tmp_path_factory.mktemp("run") / "store"
    result = ensemble("run", *QUICK_SCENE, f"--store={store}", "--json")
    assert result.returncode == 0, result.stderr
    return store, json.loads(result.stdout)


def test_run_prints_the_documented_fields(stored_run):
    _, document = stored_run
    assert document.keys() == RUN_FIELDS
    assert document["outcome"] == "bound"
    assert document["failure"] is None
    assert document["inclination_angle"] is None, "a doublet has none"
    assert document["viscosity"].keys() == {"total", "bending_tension", "adhesion", "contrast"}
    assert document["energy"].keys() == {"bending", "adhesion", "binding"}
    assert document["error"].keys() == ERRORS
    parts = document["viscosity"]["bending_tension"] + document["viscosity"]["adhesion"]
    assert math.isclose(document["viscosity"]["total"], parts)


def test_run_with_no_store_keeps_nothing_and_repeats_the_same_numbers(ensemble, stored_run, tmp_path):
    result = ensemble("run", *QUICK_SCENE, "--no-store", "--json", cwd=tmp_path)
    document, kept = json.loads(result.stdout), stored_run[1]
    assert list(tmp_path.iterdir()) == []
    assert document | {"wall_seconds": None} == kept | {"wall_seconds": None}


def test_show_takes_the_beginning_of_a_key_and_prints_the_scene_or_the_record(ensemble, stored_run):
    store, document = stored_run
    shown = ensemble("show", document["run_key"][:6], f"--store={store}")
    assert shown.returncode == 0, shown.stderr
    fields = dict(line.split("\t") for line in shown.stdout.splitlines())
    assert fields["run_key"] == document["run_key"]
    assert fields["scene.flow.kind"] == "shear"
    record = json.loads(ensemble("show", document["run_key"][:6], f"--store={store}", "--json").stdout)
    assert record["key"] == document["run_key"]
    assert record["scene"]["flow"]["kind"] == "shear"


def test_a_run_says_where_it_is_kept_and_how_to_draw_it(ensemble, stored_run, tmp_path):
    store, document = stored_run
    (*_, last) = ensemble("run", *QUICK_SCENE, f"--store={store}").stdout.splitlines()
    command = last.partition("to draw it: ")[2].split()
    assert command[:3] == ["ensemble", "show", document["run_key"][:8]]
    assert ensemble(*command[1:], cwd=tmp_path).returncode == 0
    assert (tmp_path / "run.png").stat().st_size > 0


def test_the_presets_are_listed_and_each_is_printed_as_its_document(ensemble, tmp_path):
    rows = [line.split("\t") for line in ensemble("presets").stdout.splitlines()]
    assert rows[0] == ["preset", "command", "what it is"]
    assert [row[0] for row in rows[1:]] == list(preset_names())
    assert all(len(row) == 3 and row[2] for row in rows[1:])
    copy = tmp_path / "mine.toml"
    copy.write_text(ensemble("presets", "critical-hamaker").stdout)
    assert load_study(copy) == load_study("critical-hamaker")


def test_a_run_that_the_store_has_is_not_made_again(ensemble, stored_run):
    store, document = stored_run
    again = ensemble("run", *QUICK_SCENE, f"--store={store}", "--json")
    assert json.loads(again.stdout) == document, "to the last bit of the time that it took"


@pytest.mark.parametrize("command", ["run", pytest.param("bisect", marks=pytest.mark.long)])
def test_a_program_reads_progress_in_lines_of_json(ensemble, bisect_command, tmp_path, command):
    study = bisect_command(tmp_path / "store")[3:]
    arguments = study if command == "bisect" else ["run", *QUICK_SCENE, "--no-store", "--json"]
    result = ensemble(*arguments, "--progress=json")
    assert result.returncode == 0, result.stderr
    json.loads(result.stdout)
    lines = [json.loads(line) for line in result.stderr.splitlines()]
    assert len(lines) > 5
    assert all(line.keys() == {"fraction", "message", "reached"} for line in lines)
    assert all(0 <= line["fraction"] <= 1 for line in lines)
    assert any(0 < line["fraction"] < 1 for line in lines)


def test_run_under_a_launcher_is_one_run(launcher):
    changes = ["numerics.points=32", "horizon=1.0"]
    options = [f"--set={change}" for change in changes]
    result = launcher.run(
        2, [sys.executable, "-m", "ensemble", "run", "doublet-shear", *options, "--no-store", "--json"]
    )
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["run_key"] == run_key(load_scene("doublet-shear", changes))


def test_run_loads_no_library_it_does_not_need(ensemble):
    script = (
        "import sys\n"
        f"sys.argv = ['ensemble', 'run', *{QUICK_SCENE!r}, '--no-store', '--json']\n"
        "from ensemble.cli.main import main\n"
        "try:\n    main()\n"
        "finally:\n    print(sorted({'zarr', 'mpi4py', 'sqlalchemy', 'matplotlib'} & sys.modules.keys()),"
        " file=sys.stderr)\n"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert result.stderr.strip() == "[]"


def test_bisect_prints_the_documented_fields(finished_study):
    document = finished_study.document
    assert document.keys() == {"study", "boundary", "criteria", "wall_seconds", "busy_fraction", "store"}
    assert document["study"].startswith("critical-hamaker, scene.numerics.points=32, ")
    assert Path(document["store"]) == finished_study.store
    assert [point["parameters"] for point in document["boundary"]] == [
        {"flow.rate": rate} for rate in (0.5, 0.75, 1.0)
    ]
    for point in document["boundary"]:
        assert point.keys() == POINT_FIELDS
        low, high = point["bracket"]
        assert low < point["critical_value"] < high < 1.3 * low
        assert point["outcomes"] == ["separated", "bound"]
        assert point["status"] == "converged"
    # Where others have found it: 0.3 to 0.4 and 0.6 to 0.7.
    first, _, second = (point["bracket"] for point in document["boundary"])
    assert first[0] < 0.4
    assert first[1] > 0.3
    assert second[0] < 0.7
    assert second[1] > 0.6


def test_progress_off_a_terminal_is_plain_lines(finished_study):
    lines = finished_study.progress.splitlines()
    assert any(line.startswith("flow.rate 0.5:") and "converged" in line for line in lines)
    assert any(line.startswith("flow.rate 1:") and "converged" in line for line in lines)
    assert "\x1b" not in finished_study.progress


def test_the_exit_status_tells_that_a_search_did_not_converge(ensemble, tmp_path):
    # Bound already at the weakest adhesion that may be tried: there is nothing to bracket.
    result = ensemble(
        "bisect",
        "--set=sweep.values=[0.5]",
        "--set=search.limits=[1.5, 2.5]",
        "--set=search.guesses=[{at = 0.5, bracket = [1.6, 2.4]}]",
        "--set=scene.numerics.points=32",
        "--set=scene.numerics.tolerance=1e-3",
        "--tolerance=0.3",
        f"--store={tmp_path / 'store'}",
        "--json",
    )
    assert result.returncode == INCOMPLETE_STATUS, result.stderr
    (point,) = json.loads(result.stdout)["boundary"]
    assert point["status"] == "unbracketed"
    assert point["bracket"][0] is None
    assert point["critical_value"] is None


def test_a_run_that_fails_at_its_start_is_an_outcome(ensemble, tmp_path):
    slender = ["--set=vesicles.reduced_area=0.03", f"--store={tmp_path / 'store'}"]
    result = ensemble("run", "vesicle-shear", *slender, "--json")
    assert result.returncode == INCOMPLETE_STATUS, result.stderr
    document = json.loads(result.stdout, parse_constant=pytest.fail)
    assert set(document) == RUN_FIELDS
    assert document["outcome"] == "failed"
    assert "64 points do not resolve the scene" in document["failure"]
    assert document["time"] == 0.0
    assert document["error"]["spatial"] > 1e-3
    picture = tmp_path / "start.svg"
    shown = ensemble("show", document["run_key"], f"--store={tmp_path / 'store'}", f"--output={picture}")
    assert shown.returncode == 0, shown.stderr
    assert picture.stat().st_size > 0


def test_query_finds_what_meets_the_conditions(ensemble, finished_study):
    store = f"--store={finished_study.store}"
    every = json.loads(ensemble("query", "runs", store, "--json").stdout)
    bound = json.loads(
        ensemble("query", "runs", "--where=outcome=bound", "--where=flow.rate=0.5", store, "--json").stdout
    )
    keys = {key for point in finished_study.document["boundary"] for key in point["runs"]}
    assert {summary["key"] for summary in every} == keys
    expected = [s["key"] for s in every if s["outcome"] == "bound" and s["scene"]["flow"]["rate"] == 0.5]
    assert expected
    assert [summary["key"] for summary in bound] == expected
    (boundary,) = json.loads(ensemble("query", "boundaries", store, "--json").stdout)
    assert [point["bracket"] for point in boundary["points"]] == [
        point["bracket"] for point in finished_study.document["boundary"]
    ]
    refused = ensemble("query", "runs", "--where=no_such_field=1", store)
    assert refused.returncode == 2
    assert "where: unknown field 'no_such_field'" in refused.stderr


def test_query_sorts_limits_and_shows_the_columns_that_are_asked_for(ensemble, finished_study):
    """Takes 5 s."""
    store = f"--store={finished_study.store}"
    shown = "--columns=adhesion.hamaker,vesicles.reduced_area"
    found = ensemble("query", "runs", store, "--sort=-adhesion.hamaker", "--limit=2", shown, "--columns=key")
    heading, *rows = (line.split("\t") for line in found.stdout.splitlines())
    assert heading == ["adhesion.hamaker", "vesicles.reduced_area", "key"]
    every = json.loads(ensemble("query", "runs", store, "--json", "--limit=0").stdout)
    strongest = sorted((run["scene"]["adhesion"]["hamaker"] for run in every), reverse=True)[:2]
    assert [row[:2] for row in rows] == [[f"{hamaker:.6g}", "0.9"] for hamaker in strongest]
    assert "more than 2; --limit 0" in found.stderr
    for option in ("columns", "sort"):
        refused = ensemble("query", "runs", store, f"--{option}=flow.rat")
        assert refused.returncode == 2
        assert f"{option}: unknown field 'flow.rat'" in refused.stderr


def test_tables_are_for_people(ensemble, finished_study, stored_run):
    store = f"--store={finished_study.store}"
    runs = ensemble("query", "runs", store).stdout
    assert all(key in runs for point in finished_study.document["boundary"] for key in point["runs"])
    assert "converged" in ensemble("show", "critical-hamaker", store).stdout
    shown = ensemble("show", stored_run[1]["run_key"], f"--store={stored_run[0]}").stdout
    assert "viscosity.total" in shown


def test_show_draws_runs_and_boundaries(ensemble, finished_study, stored_run, tmp_path):
    diagram, history = tmp_path / "diagram.png", tmp_path / "history.svg"
    assert (
        ensemble(
            "show", "critical-hamaker", f"--store={finished_study.store}", f"--output={diagram}"
        ).returncode
        == 0
    )
    assert (
        ensemble(
            "show", stored_run[1]["run_key"], f"--store={stored_run[0]}", f"--output={history}"
        ).returncode
        == 0
    )
    assert diagram.read_bytes().startswith(b"\x89PNG")
    assert "<svg" in history.read_text()
    refused = ensemble(
        "show", stored_run[1]["run_key"], f"--store={stored_run[0]}", f"--output={tmp_path / 'history.doc'}"
    )
    assert refused.returncode == 2
    assert "output: must end in .png, .svg, .pdf, .mp4 or .gif" in refused.stderr
    assert not (tmp_path / "history.doc").exists()


def test_a_boundary_is_no_movie(ensemble, finished_study, tmp_path):
    refused = ensemble(
        "show", "critical-hamaker", f"--store={finished_study.store}", f"--output={tmp_path / 'diagram.mp4'}"
    )
    assert refused.returncode == 2
    assert "output: only a run can be a movie, critical-hamaker" in refused.stderr
    assert list(tmp_path.iterdir()) == []


def test_show_and_export_refuse_what_the_store_does_not_have(ensemble, stored_run, tmp_path):
    for command in (["show", "nothing"], ["export", "nothing", str(tmp_path / "run.h5")]):
        result = ensemble(*command, f"--store={stored_run[0]}")
        assert result.returncode == 2
        assert "nothing" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_export_writes_one_file(ensemble, stored_run, tmp_path):
    file = tmp_path / "run.h5"
    store, document = stored_run
    assert ensemble("export", document["run_key"], str(file), f"--store={store}").returncode == 0
    with h5py.File(file) as exported:
        assert json.loads(exported.attrs["key"]) == document["run_key"]
        assert exported["tangent_angle"].shape[1:] == (2, 32)
        assert exported["x"].shape[1:] == (2, 32)
        assert "bending_force" not in exported


def test_export_writes_what_its_suffix_says(ensemble, stored_run, tmp_path):
    file = tmp_path / "run.vtkhdf"
    store, document = stored_run
    key = document["run_key"]
    assert ensemble("export", key, str(file), "--forces", f"--store={store}").returncode == 0
    with h5py.File(file) as exported:
        assert {"tension", "bending_force", "tension_force"} <= exported["VTKHDF/PointData"].keys()
    refused = ensemble("export", key, str(tmp_path / "run.vtu"), f"--store={store}")
    assert refused.returncode == 2
    assert "run.vtu" in refused.stderr
    assert ".vtkhdf" in refused.stderr
    assert list(tmp_path.iterdir()) == [file]


def test_check_finds_damage(ensemble, stored_run, tmp_path):
    store = shutil.copytree(stored_run[0], tmp_path / "store")
    assert ensemble("check", f"--store={store}").returncode == 0
    (directory, *_) = sorted((store / "runs").iterdir())
    with unpacked(directory) as files:
        chunk = files / "gap" / "c" / "0"
        chunk.write_bytes(chunk.read_bytes()[:-1] + b"?")
    damaged = ensemble("check", f"--store={store}", "--json")
    assert damaged.returncode == 1
    (problem,) = json.loads(damaged.stdout)["problems"]
    assert "gap" in problem


def test_other_packages_add_commands(ensemble, tmp_path):
    (tmp_path / "addition.py").write_text(
        'def greet(name: str) -> None:\n    """Greet."""\n    print("hello", name)\n'
    )
    information = tmp_path / "addition-1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: addition\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text("[ensemble.commands]\ngreet = addition:greet\n")
    path = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    result = ensemble("greet", "Ada", environment={"PYTHONPATH": path})
    assert result.returncode == 0, result.stderr
    assert result.stdout == "hello Ada\n"


def test_the_version_is_that_of_the_distribution(ensemble):
    result = ensemble("--version")
    assert (result.returncode, result.stdout.strip()) == (0, version("vesicle-ensemble"))


def test_shells_complete_commands_presets_and_kinds(ensemble):
    def completed(*words: str) -> list[str]:
        environment = {
            "_ENSEMBLE_COMPLETE": "complete_bash",
            "COMP_WORDS": " ".join(["ensemble", *words]),
            "COMP_CWORD": str(len(words)),
        }
        return ensemble(environment=environment).stdout.split()

    assert completed("bis") == ["bisect"]
    assert completed("run", "vesicle-s") == ["vesicle-shear"]
    assert completed("schema", "st") == ["study"]


def test_the_schema_of_a_kind_of_documents_is_printed(ensemble):
    assert json.loads(ensemble("schema", "scene").stdout)["required"] == ["horizon"]
    refused = ensemble("schema", "novel")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "kinds: study, map, measurement, scene" in refused.stderr
