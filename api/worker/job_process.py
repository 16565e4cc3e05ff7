"""The command of one attempt, with all of its descendants and its output."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import IO

from pydantic import ValidationError

from api.worker.job_log import JobLog
from ensemble.display.progress_line import ProgressLine

_END_SECONDS = 5.0


class Process(AbstractContextManager["Process"]):
    """A command in its own session; neither it nor a descendant of it outlives this process.

    Use it as a context manager; leaving the block ends what is left.

    Parameters
    ----------
    command : sequence of str
        Program and arguments.
    log : JobLog
        Takes standard error.

    Attributes
    ----------
    progress : ProgressLine
        The latest one that the command has written to standard error.
    """

    def __init__(self, command: Sequence[str], log: JobLog) -> None:
        self.progress = ProgressLine(fraction=0.0, message="starting", reached=0.0)
        self._output: IO[str] = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115
        self._watcher = subprocess.Popen(
            [sys.executable, "-P", "-m", "api.worker.watcher", *command],
            stdin=subprocess.PIPE,  # its end tells the watcher that this process is gone
            stdout=self._output,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            env=_environment(os.environ),
            start_new_session=True,
        )
        self._reader = threading.Thread(target=self._read, args=(log,), name="log", daemon=True)
        self._reader.start()

    def wait(self, seconds: float) -> int | None:
        """Wait for the end of the command.

        Parameters
        ----------
        seconds : float
            Longest time to wait.

        Returns
        -------
        int or None
            Exit status; 128 and the signal if one ended it.  None if it is still running.
        """
        try:
            status = self._watcher.wait(seconds)
        except subprocess.TimeoutExpired:
            return None
        self._reader.join(_END_SECONDS)
        return status if status >= 0 else 128 - status

    def output(self) -> str:
        """Return the standard output so far."""
        self._output.seek(0)
        return self._output.read()

    def suspend(self, seconds: float) -> None:
        """Let the command keep its runs and end; kill it if that takes longer.

        Parameters
        ----------
        seconds : float
            Longest time to wait.
        """
        self._watcher.send_signal(signal.SIGTERM)
        with suppress(subprocess.TimeoutExpired):
            self._watcher.wait(seconds)
        self.end()

    def end(self) -> None:
        """Kill the command and all of its descendants; none is left when this returns."""
        assert self._watcher.stdin is not None
        self._watcher.stdin.close()
        self._watcher.wait()

    def __exit__(self, *_: object) -> None:
        self.end()
        self._reader.join(_END_SECONDS)
        self._output.close()

    def _read(self, log: JobLog) -> None:
        assert self._watcher.stderr is not None
        with self._watcher.stderr as lines:
            for line in lines:
                try:
                    self.progress = ProgressLine.model_validate_json(line)
                except ValidationError:
                    log.add(line)
                else:
                    log.add_progress(self.progress)


def _environment(environment: Mapping[str, str]) -> dict[str, str]:
    # The launcher finds its helpers by PATH.
    path = os.pathsep.join([str(Path(sys.executable).parent), environment.get("PATH", os.defpath)])
    return {**environment, "PATH": path}
