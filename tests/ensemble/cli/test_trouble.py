"""Trouble that users' machines have: one line each, nothing lost, nothing wrong in silence."""

from __future__ import annotations

import json
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from ensemble.questions import INCOMPLETE_STATUS
from tests.conftest import ENSEMBLE, QUICK_STUDY, SECONDS
from tests.ensemble.group_files import unpacked

QUICK = ("vesicle-shear", "--set=horizon=1", "--set=numerics.points=32", "--set=numerics.tolerance=1e-3")


@pytest.fixture(scope="module")
def stored_run(
    ensemble: Callable[..., subprocess.CompletedProcess[str]], tmp_path_factory
) -> tuple[Path, str]:
    """A store with a run in it, and the run's key."""
    store = tmp_path_factory.mktemp("stored") / "store"
    result = ensemble("run", *QUICK, "--store", str(store), "--json")
    assert result.returncode == 0, result.stderr
    return store, json.loads(result.stdout)["run_key"]


def test_what_a_terminal_cannot_show_is_replaced(ensemble, finished_study) -> None:
    result = ensemble(
        "show",
        "critical-hamaker",
        f"--store={finished_study.store}",
        environment={"PYTHONIOENCODING": "ascii"},
    )
    assert result.returncode == 0, result.stderr
    assert "converged" in result.stdout


def test_redirected_tables_hold_whole_values_separated_by_tabs(ensemble, finished_study) -> None:
    result = ensemble("show", "critical-hamaker", f"--store={finished_study.store}")
    header, *rows = [line.split("\t") for line in result.stdout.splitlines()]
    assert header[:4] == ["flow.rate", "critical value", "bracket", "outcomes"]
    assert len(rows) == 3
    assert all(len(row) == len(header) for row in rows)
    assert {row[3] for row in rows} == {"separated | bound"}
    assert "…" not in result.stdout


def test_ranks_with_different_arguments_are_refused(launcher) -> None:
    """As farms of runs are started that mean something else."""
    python = [sys.executable, "-m", "ensemble", "run"]
    command = [launcher.mpirun, "-n", "1", *python, "vesicle-shear", ":", "-n", "1", *python, "doublet-shear"]
    result = subprocess.run(
        command, env=launcher.environment, capture_output=True, text=True, timeout=240, check=False
    )
    assert result.returncode == 2
    assert "arguments: rank 1 has 'run doublet-shear' and rank 0 'run vesicle-shear'" in result.stderr
    assert "Traceback" not in result.stderr


def test_a_rank_that_refuses_its_arguments_ends_the_others(launcher, tmp_path: Path) -> None:
    """They would wait for it for ever, at full load."""
    python = [sys.executable, "-m", "ensemble", "bisect", f"--store={tmp_path / 'store'}"]
    command = [launcher.mpirun, "-n", "1", *python, ":", "-n", "1", *python, "--nonsense"]
    result = subprocess.run(
        command, env=launcher.environment, capture_output=True, text=True, timeout=240, check=False
    )
    assert result.returncode == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith("ensemble: arguments: rank 1 has")
    assert not (tmp_path / "store").exists()


def test_what_only_the_first_rank_looks_at_is_refused_on_all(launcher, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    command = ["run", *QUICK, "--again", f"--store={tmp_path / 'file'}"]
    result = launcher.run(2, [*ENSEMBLE, *command])
    assert result.returncode == 2
    (line,) = result.stderr.splitlines()
    assert "is a file" in line


def test_a_rank_in_another_directory_uses_the_store_of_the_first(launcher, tmp_path: Path) -> None:
    """The address of the store is relative, and only the first rank is where it leads to it."""
    (tmp_path / "elsewhere").mkdir()
    script = f'[ "$PMI_RANK" = 1 ] && cd {tmp_path}/elsewhere; cd . ; exec "$@"'
    # Bound at every adhesion that may be tried: each rank makes one run.
    study = ["bisect", "--set=sweep.values=[0.5]", "--set=search.limits=[1.5, 2.5]", "--tolerance=0.3"]
    study += ["--set=search.guesses=[{at = 0.5, bracket = [1.6, 2.4]}]", "--set=scene.numerics.points=32"]
    study += ["--set=scene.numerics.tolerance=1e-3", "--store=relative", "--json"]
    result = subprocess.run(
        launcher.command(2, ["sh", "-c", script, "sh", *ENSEMBLE, *study]),
        env=launcher.environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert result.returncode == INCOMPLETE_STATUS, result.stderr
    assert (tmp_path / "relative").is_dir()
    assert list((tmp_path / "elsewhere").iterdir()) == []


@pytest.mark.parametrize("name", ["a\nb", "", "x" * 101, "bell\x07"])
def test_unfit_names_of_studies_are_refused_where_they_enter(ensemble, tmp_path: Path, name: str) -> None:
    result = ensemble("bisect", f"--set=name={json.dumps(name)}", f"--store={tmp_path / 'store'}")
    assert result.returncode == 2
    assert "name" in result.stderr
    assert not (tmp_path / "store").exists()


def test_markup_in_a_name_is_text(ensemble, finished_study, tmp_path: Path) -> None:
    store = shutil.copytree(finished_study.store, tmp_path / "store")
    name = "a[/b] [red]c"
    assert (
        ensemble("bisect", *QUICK_STUDY, f"--set=name={json.dumps(name)}", f"--store={store}").returncode == 0
    )
    for command in (["query", "boundaries"], ["show", name]):
        result = ensemble(*command, f"--store={store}")
        assert result.returncode == 0, result.stderr
    assert name in ensemble("query", "boundaries", f"--store={store}").stdout


def test_a_run_is_made_again_and_the_earlier_one_is_kept(ensemble, stored_run, tmp_path: Path) -> None:
    store, key = stored_run
    store = shutil.copytree(store, tmp_path / "store")
    result = ensemble("run", *QUICK, "--store", str(store), "--again", "--json")
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["run_key"] == key
    assert (store / "lost+found" / key).is_dir()
    assert (store / "runs" / key).is_dir()


def test_a_damaged_run_is_named_set_aside_and_made_again(ensemble, stored_run, tmp_path: Path) -> None:
    store, key = stored_run
    store = shutil.copytree(store, tmp_path / "store")
    with unpacked(store / "runs" / key) as files:
        shutil.rmtree(files / "tangent_angle")
    for command in (
        ["show", key, "--output", str(tmp_path / "run.png")],
        ["export", key, str(tmp_path / "run.h5")],
    ):
        result = ensemble(*command, f"--store={store}")
        assert result.returncode == 1
        (line,) = result.stderr.splitlines()
        assert key in line
        assert "missing" in line
    assert ensemble("check", f"--store={store}").returncode == 1
    repaired = ensemble("check", "--repair", f"--store={store}")
    assert repaired.returncode == 0, repaired.stdout
    assert "set aside" in repaired.stdout
    assert ensemble("run", *QUICK, "--store", str(store)).returncode == 0
    assert ensemble("check", f"--store={store}").returncode == 0


LOADED = """
import sys
from ensemble.__main__ import main
store, *drawings = sys.argv[1:]
for drawing in drawings:
    sys.argv[1:] = ["show", *drawing.split("=", 1), store]
    try:
        main()
    except SystemExit as end:
        assert not end.code
print(sorted({name.partition(".")[0] for name in sys.modules} & {"numba", "llvmlite", "mpi4py"}))
"""


def test_drawing_a_stored_run_loads_no_compiler(ensemble, stored_run, tmp_path: Path) -> None:
    store, key = stored_run
    store = shutil.copytree(store, tmp_path / "store")
    # A run that ends at its start has one state, which makes the shortest movie.
    still = ensemble("run", *QUICK, "--set=numerics.work_limit=1", f"--store={store}", "--json")
    files = {tmp_path / "run.png": key, tmp_path / "run.gif": json.loads(still.stdout)["run_key"]}
    drawings = [f"{key}=--output={path}" for path, key in files.items()]
    result = subprocess.run(
        [sys.executable, "-c", LOADED, f"--store={store}", *drawings],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.stdout == "[]\n", result.stderr
    assert [path.read_bytes()[:4] for path in files] == [b"\x89PNG", b"GIF8"]


def test_stores_are_merged(ensemble, stored_run, finished_study, tmp_path: Path) -> None:
    store, key = stored_run
    target = shutil.copytree(finished_study.store, tmp_path / "store")
    assert ensemble("merge", str(store), "--into", str(target), "--json").stdout.count('"runs": 1') == 1
    assert ensemble("show", key, f"--store={target}").returncode == 0
    assert ensemble("check", f"--store={target}").returncode == 0


SIGNALLED_EARLY = """
import os, signal
import ensemble.__main__ as command
if os.environ["PMI_RANK"] == "1":
    command.end_with_launcher = lambda: os.kill(os.getpid(), signal.SIGTERM)
command.main()
"""


def test_a_rank_that_a_signal_ends_before_mpi_begins_ends_the_others(launcher, tmp_path: Path) -> None:
    """A launcher ignores a rank that ends with a status before it has joined the others."""
    store = tmp_path / "store"
    result = launcher.run(2, [sys.executable, "-c", SIGNALLED_EARLY, "bisect", f"--store={store}"])
    assert result.returncode != 0
    assert "Traceback" not in result.stderr
    assert alive(str(store)) == []


def alive(marker: str) -> list[psutil.Process]:
    """Processes whose arguments hold a text."""
    found = []
    for process in psutil.process_iter():
        try:
            if any(marker in argument for argument in process.cmdline()):
                found.append(process)
        except psutil.Error:
            continue
    return found


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_a_signal_ends_a_study_with_one_line(launcher, tmp_path: Path, ranks: int, number: int) -> None:
    """The second tier, in `tests/ensemble/test_signals.py`, tries many more moments."""
    moment = random.Random(int(number) + ranks)
    store = tmp_path / "store"
    with launcher.start(ranks, [*ENSEMBLE, "bisect", f"--store={store}"]) as job:
        time.sleep(moment.uniform(0.5, 4.0))
        job.send_signal(number)
        _, said = job.communicate(timeout=60)
    assert job.returncode != 0
    assert "Traceback" not in said
    assert said.count("interrupted") <= 1
    assert alive(str(store)) == []


@pytest.mark.parametrize("command", [["presets"], ["presets", "doublet-shear"]])
def test_output_that_nobody_reads_any_more_ends_a_command_silently(command: list[str]) -> None:
    """As `ensemble presets | head -n 1` may do, with output that does or does not fit into a buffer.  3 s."""
    process = subprocess.Popen([*ENSEMBLE, *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    assert process.stderr.read() == b""
    assert process.wait() == 1


@pytest.mark.parametrize("nowhere", ["closed pipe", "full disk"])
def test_a_study_whose_progress_nobody_reads_ends(nowhere: str, tmp_path: Path) -> None:
    """Its runs are kept, and the same command goes on; 3 s each."""
    command = [*ENSEMBLE, "bisect", *QUICK_STUDY, f"--store={tmp_path / 'store'}"]
    with open("/dev/full", "wb") as full:
        errors = full if nowhere == "full disk" else subprocess.PIPE
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=errors)
        if process.stderr is not None:
            process.stderr.readline()
            process.stderr.close()
        assert process.wait(SECONDS) == 1
