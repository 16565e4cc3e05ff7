"""Running the command line as users do: as processes of its own, under a launcher or without."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hypothesis
import pytest

from tests import postgresql, slurm
from tests.forked_commands import forked_commands
from tests.processor_time import ProcessorTimes

# Before anything imports NumPy: the tests run in several processes, whose threads would compete.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# An example may take any time: the machine may be busy.
hypothesis.settings.register_profile(
    "patient", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("patient")

ENSEMBLE = (sys.executable, "-m", "ensemble")
SECONDS = 800  # until a process is given up: a machine may be busy, so no test measures time by this

# Three points of the preset's boundary at a coarse resolution: a dozen runs of about half a second.
QUICK_STUDY = (
    "--set=sweep.values=[0.5, 0.75, 1.0]",
    "--set=scene.numerics.points=32",
    "--set=scene.numerics.tolerance=1e-3",
    "--tolerance=0.1",
)


def pytest_configure(config: pytest.Config) -> None:
    """Measure what the tests cost."""
    config.pluginmanager.register(ProcessorTimes(config.getoption("durations")))


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the kernels before there are processes that would each compile the same ones.

    Two processes begin at either end; what one of them has compiled the other one loads.
    """
    if session.config.getoption("numprocesses") and not hasattr(session.config, "workerinput"):
        command = [sys.executable, "-m", "tests.solver.compile_kernels"]
        both = [
            subprocess.Popen([*command, *order], cwd=session.config.rootpath) for order in ([], ["reversed"])
        ]
        assert [process.wait() for process in both] == [0, 0]


@dataclass(frozen=True)
class Launcher:
    """Starts Python processes, under `mpirun` where ranks are asked for."""

    mpirun: str

    def command(self, ranks: int, arguments: Sequence[str]) -> list[str]:
        return [self.mpirun, "-n", str(ranks), *arguments]

    @property
    def environment(self) -> dict[str, str]:
        # The launcher finds its helpers by PATH.
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        return os.environ | {"PATH": path}

    def start(self, ranks: int, arguments: Sequence[str], **options: Any) -> subprocess.Popen[str]:
        return subprocess.Popen(
            self.command(ranks, arguments),
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            **options,
        )

    def run(self, ranks: int, arguments: Sequence[str]) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            self.command(ranks, arguments),
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=SECONDS,
            check=False,
        )


@pytest.fixture(scope="session")
def launcher() -> Launcher:
    """The launcher that belongs to the environment's MPI library, or the one that MPIRUN names.

    Another library than the environment's is loaded by mpi4py's own variables, for Debian's Open MPI
    MPIRUN=/usr/bin/mpirun MPI4PY_MPIABI=openmpi MPI4PY_LIBMPI=libmpi.so.40.
    """
    beside = Path(sys.executable).with_name("mpirun")
    mpirun = os.environ.get("MPIRUN") or (str(beside) if beside.exists() else shutil.which("mpirun"))
    if mpirun is None:
        pytest.skip("no mpirun: install the extra mpich")
    return Launcher(mpirun)


@pytest.fixture(scope="session")
def ensemble() -> Iterator[Callable[..., subprocess.CompletedProcess[str]]]:
    """Run a command in a process of its own, without a launcher.

    It is started where it gets variables: libraries may read them when they are imported.  Else it is forked.
    With a size, a command can write no file of more bytes.
    """

    def run(
        *arguments: str,
        cwd: Path | None = None,
        environment: Mapping[str, str] = {},
        largest_file: int | None = None,
    ) -> subprocess.CompletedProcess[str]:
        if not environment:
            return forked.run(list(arguments), cwd, os.environ, largest_file)
        assert largest_file is None
        return subprocess.run(
            [*ENSEMBLE, *arguments],
            env=os.environ | environment,
            cwd=cwd,
            capture_output=True,
            text=True,
            timeout=SECONDS,
            check=False,
        )

    with forked_commands() as forked:
        yield run


@pytest.fixture(scope="session")
def bisect_command() -> Callable[[Path], list[str]]:
    """The arguments that trace the quick study into a store."""
    return lambda store: [*ENSEMBLE, "bisect", *QUICK_STUDY, "--store", str(store), "--json"]


@dataclass(frozen=True)
class Finished:
    """The quick study, traced without interruption on two ranks."""

    store: Path
    document: dict[str, Any]
    progress: str


@pytest.fixture(scope="session")
def session_directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory that all processes of a test session share."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


@pytest.fixture(scope="session")
def finished_study(
    launcher: Launcher, bisect_command: Callable[[Path], list[str]], session_directory: Path
) -> Finished:
    """The quick study in a store; tests may read it and ask for it again.

    The first process that needs it traces it; the others wait and read the same store.
    """
    store = session_directory / "finished" / "store"
    printed = store.with_name("printed.json")
    store.parent.mkdir(exist_ok=True)
    with store.with_name("lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not printed.exists():
            result = launcher.run(2, bisect_command(store))
            assert result.returncode == 0, result.stderr
            printed.write_text(json.dumps([result.stdout, result.stderr]))
    stdout, stderr = json.loads(printed.read_text())
    return Finished(store, json.loads(stdout), stderr)


@pytest.fixture(scope="session")
def postgresql_server() -> Iterator[postgresql.Server]:
    """A PostgreSQL server."""
    programs = postgresql.programs()
    if programs is None:
        pytest.skip("no PostgreSQL server: install the system's package")
    with postgresql.running(programs) as server:
        yield server


@pytest.fixture(scope="session")
def slurm_cluster() -> Iterator[slurm.Cluster]:
    """A Slurm cluster of one node.  It starts in two seconds."""
    if reason := slurm.reason_to_skip():
        pytest.skip(reason)
    with slurm.running() as cluster:
        yield cluster
