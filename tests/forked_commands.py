"""Runs commands in processes that are forked from one which has imported the packages.

To import them takes a second, which is most of what most commands take.  Everything else is as for a process
that is started: arguments, environment, directory, streams, signals and the status with which it ends.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

from tests import processor_time

LAZY = (
    "api.auth.tokens",
    "api.serve",
    "h5netcdf",
    "matplotlib.backends.backend_agg",
    "matplotlib.backends.backend_svg",
    "scipy.interpolate",
)


class ForkedCommands:
    """The process that forks, as its user sees it.

    Parameters
    ----------
    process : Popen
        Takes a request in a line and answers in a line, with the status of the command and what it cost.

    Attributes
    ----------
    counted : float
        Processor time of the commands, which is counted while the tests run that asked for them.
    """

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self.counted = 0.0

    def run(
        self,
        arguments: list[str],
        directory: Path | None,
        environment: Mapping[str, str],
        largest_file: int | None,
    ) -> subprocess.CompletedProcess[str]:
        """Run a command to its end; where a size is given, it can write no file of more bytes."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with tempfile.TemporaryDirectory() as folder:
            streams = [Path(folder) / name for name in ("stdout", "stderr")]
            request = {
                "arguments": arguments,
                "directory": str(directory or Path.cwd()),
                "environment": dict(environment),
                "largest_file": largest_file,
                "streams": list(map(str, streams)),
            }
            print(json.dumps(request), file=self._process.stdin, flush=True)
            status, seconds = json.loads(self._process.stdout.readline())
            self.counted += seconds
            processor_time.add(seconds)
            return subprocess.CompletedProcess(arguments, status, *(path.read_text() for path in streams))


@contextmanager
def forked_commands() -> Iterator[ForkedCommands]:
    """Have a process that has imported the packages as long as a block runs."""
    command = [sys.executable, "-m", "tests.forked_commands"]
    root = Path(__file__).resolve().parents[1]
    with subprocess.Popen(
        command, cwd=root, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        commands = ForkedCommands(process)
        yield commands
    processor_time.add(-commands.counted)  # now that of an ended child


def _import_everything() -> None:
    import ensemble

    for module in walk_packages(ensemble.__path__, "ensemble."):
        if not module.name.endswith("__main__"):
            import_module(module.name)
    for name in LAZY:
        import_module(name)
    assert "mpi4py.MPI" not in sys.modules, "it begins MPI, once for each process"
    assert len(os.listdir("/proc/self/task")) == 1, "a thread is not forked, and what it locked stays locked"


def _serve() -> None:
    """Run a command for each line of standard input."""
    context = multiprocessing.get_context("fork")
    for line in sys.stdin:
        process = context.Process(target=_run, kwargs=json.loads(line))
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        process.start()
        process.join()
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        print(json.dumps([process.exitcode, seconds]), flush=True)


def _run(
    arguments: list[str],
    directory: str,
    environment: dict[str, str],
    largest_file: int | None,
    streams: list[str],
) -> None:
    from ensemble.__main__ import main

    sys.argv = ["ensemble", *arguments]
    os.chdir(directory)
    os.environ.clear()
    os.environ.update(environment)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for number, path in enumerate(streams, start=1):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT), number)
    if largest_file is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))
    main()


if __name__ == "__main__":
    from ensemble.mpi.world import pin_threads

    pin_threads()
    _import_everything()
    _serve()
