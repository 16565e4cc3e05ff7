"""The files of `deploy/`: what they copy suffices, and every command in them exists with its options."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from sqlalchemy import make_url

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "deploy"
UNITS = sorted(DEPLOY.glob("*.service"))
SECONDS = 240
MOST_EXPOSED = 30  # tenths, of the ten that `systemd-analyze security` counts to

# Starts two ranks, as Slurm's own would start as many as the job has; `test_slurm.py` has the real one.
SRUN = """\
#!/usr/bin/env bash
while [[ $1 == --* ]]; do shift; done
exec mpirun -n 2 "$@"
"""


def container_lines(instruction: str) -> list[str]:
    """Return the arguments of an instruction of the container file, each time that it is there."""
    text = (DEPLOY / "Containerfile").read_text(encoding="utf-8").replace("\\\n", " ")
    return re.findall(rf"^{instruction} (.+)$", text, flags=re.MULTILINE)


def commands() -> Iterator[tuple[str, list[str]]]:
    """Yield each command of the command line that a file gives, with the name of the file."""
    (default,) = container_lines("CMD")
    yield "Containerfile", yaml.safe_load(default)
    compose = yaml.safe_load((DEPLOY / "compose.yaml").read_text(encoding="utf-8"))
    for name, service in compose["services"].items():
        if "command" in service:
            yield f"compose.yaml: {name}", service["command"]
    for unit in UNITS:
        (started,) = re.findall(r"^ExecStart=\S+/ensemble (.+)$", unit.read_text(), flags=re.MULTILINE)
        yield unit.name, shlex.split(started)
    for line in (DEPLOY / "README.md").read_text(encoding="utf-8").replace("\\\n", " ").splitlines():
        if found := re.search(r"(?<!-t )vesicle-ensemble ([a-z].+)$| server (token .+)$", line):
            yield "README.md", shlex.split(found[1] or found[2])


@pytest.mark.parametrize(("file", "arguments"), list(commands()), ids=lambda value: str(value))
def test_commands_and_their_options_exist(ensemble, file: str, arguments: list[str]) -> None:
    # An unknown command or option is refused before the help is printed.
    result = ensemble(*arguments, "--help")
    assert result.returncode == 0, f"{file}: {result.stderr}"


def test_the_container_copies_what_the_package_is_built_from(tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.mkdir()
    for line in container_lines("COPY"):
        *names, target = line.split()
        for name in names:
            if (ROOT / name).is_dir():
                shutil.copytree(ROOT / name, source / target, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(ROOT / name, source / target)
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    built = subprocess.run(
        [*command, f"--wheel-dir={tmp_path}", str(source)], capture_output=True, text=True, timeout=SECONDS
    )
    assert built.returncode == 0, built.stderr
    assert list(tmp_path.glob("*.whl"))


@pytest.mark.parametrize("password", ["p@ss", "a/b:c", "100%25", "#?&=", "ä ö"])
def test_any_password_reaches_the_database_of_compose(password: str) -> None:
    compose = yaml.safe_load((DEPLOY / "compose.yaml").read_text(encoding="utf-8"))
    environment = {
        name: text.replace("${POSTGRES_PASSWORD:?}", password)
        for name, text in compose["services"]["server"]["environment"].items()
    }
    url = make_url(environment["ENSEMBLE_DATABASE"])
    assert (url.username, url.host, url.port, url.database) == ("ensemble", "database", None, "ensemble")
    assert (url.password or environment.get("PGPASSWORD")) == password


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd")
@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_units_are_valid(unit: Path, tmp_path: Path) -> None:
    # The units name an executable that is not on this machine.
    program = str(Path(sys.executable).with_name("ensemble"))
    text = unit.read_text(encoding="utf-8").replace("/opt/ensemble/bin/ensemble", program)
    (tmp_path / unit.name).write_text(text, encoding="utf-8")
    command = ["systemd-analyze", "verify", "--man=no", str(tmp_path / unit.name)]
    verified = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
    assert (verified.returncode, verified.stderr) == (0, "")


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd")
@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_units_may_do_little(unit: Path) -> None:
    command = ["systemd-analyze", "security", "--offline=yes", f"--threshold={MOST_EXPOSED}", str(unit)]
    judged = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
    assert judged.returncode == 0, judged.stdout


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_units_are_bounded_and_always_started_again(unit: Path) -> None:
    lines = unit.read_text(encoding="utf-8").splitlines()
    assert "StartLimitIntervalSec=0" in lines
    for limit in ("MemoryMax=", "TasksMax="):
        assert any(line.startswith(limit) for line in lines)


def test_the_batch_script_continues_a_study(finished_study, bisect_command, launcher, tmp_path: Path) -> None:
    programs = tmp_path / "bin"
    programs.mkdir()
    (programs / "srun").write_text(SRUN, encoding="utf-8")
    (programs / "srun").chmod(0o755)
    path = os.pathsep.join([str(programs), launcher.environment["PATH"]])
    store = finished_study.store
    arguments = bisect_command(store)
    changes = arguments[arguments.index("bisect") + 1 : arguments.index("--store")]
    result = subprocess.run(
        ["bash", str(DEPLOY / "bisect.slurm"), "critical-hamaker", *changes, "--json"],
        env=launcher.environment
        | {"PATH": path, "ENSEMBLE_ENVIRONMENT": sys.prefix, "ENSEMBLE_STORE": str(store)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    document = json.loads(result.stdout)
    assert document["boundary"] == finished_study.document["boundary"]
    assert Path(document["store"]) == store
