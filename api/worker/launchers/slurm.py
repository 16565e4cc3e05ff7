"""Ranks in a job of Slurm, submitted and followed by `api.worker.launchers.slurm_job`."""

from __future__ import annotations

import shlex
import shutil
import sys
from pathlib import Path

from api.worker.launchers.launcher import JobAttempt, rank_command
from api.worker.launchers.slurm_job import SlurmJob
from ensemble.errors import BadInput


class Slurm:
    """Submits each attempt to a cluster; see `Launcher`.

    Parameters
    ----------
    options : str
        Further options of `sbatch`.

    Raises
    ------
    BadInput
        If there is no `sbatch`, or the options cannot be parsed.
    """

    limits_time = True

    def __init__(self, options: str) -> None:
        if shutil.which("sbatch") is None:
            raise BadInput("launcher: slurm needs sbatch, and there is none on the PATH")
        try:
            self._options = shlex.split(options)
        except ValueError as error:
            raise BadInput(f"slurm_options: {error}") from None

    def command(self, attempt: JobAttempt) -> list[str]:
        """Return the command that submits an attempt and follows it.

        Parameters
        ----------
        attempt : JobAttempt

        Returns
        -------
        list of str
        """
        return [
            *(sys.executable, "-P", "-m", "api.worker.launchers.slurm_job"),
            f"--name={_name(attempt)}",
            f"--ranks={attempt.ranks}",
            f"--seconds={attempt.seconds}",
            f"--files={_files(attempt)}",
            *(f"--option={option}" for option in self._options),
            "--",
            *rank_command(attempt, sys.executable),
        ]

    def end(self, attempt: JobAttempt) -> None:
        """Cancel the job of Slurm, if there is one.

        Parameters
        ----------
        attempt : JobAttempt
        """
        SlurmJob(_name(attempt), _files(attempt)).end()


def _name(attempt: JobAttempt) -> str:
    return f"ensemble-{attempt.job}"


def _files(attempt: JobAttempt) -> Path:
    return attempt.log.with_suffix("")
