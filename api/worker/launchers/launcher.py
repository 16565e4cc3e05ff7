"""What a worker knows of a launcher."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

TIME_LIMIT_STATUS = 124  # exit status of a command that has ended a job at its time limit, as of `timeout`


@dataclass(frozen=True)
class JobAttempt:
    """One attempt at a job.

    Attributes
    ----------
    job : str
        Id of the job.
    ranks : int
    memory : int
        Bytes that each rank may use.
    seconds : float
        For which the ranks may run.
    arguments : sequence of str
        Of `ensemble`.
    log : Path
        Log of the job; other files of the job may lie beside it.
    """

    job: str
    ranks: int
    memory: int
    seconds: float
    arguments: Sequence[str]
    log: Path


class Launcher(Protocol):
    """Starts `ensemble` on several ranks, at low priority and with limited memory.

    Attributes
    ----------
    limits_time : bool
        Whether its command ends an attempt at its time limit, with `TIME_LIMIT_STATUS`.
    """

    limits_time: bool

    def command(self, attempt: JobAttempt) -> list[str]:
        """Return a command that runs the ranks, and ends when they have ended.

        It prints what they print, exits with their status, and lets them keep their runs and end if it is
        sent SIGTERM.

        Parameters
        ----------
        attempt : JobAttempt

        Returns
        -------
        list of str
        """

    def end(self, attempt: JobAttempt) -> None:
        """End what a killed command may have left on other machines.

        Parameters
        ----------
        attempt : JobAttempt
        """


def rank_command(attempt: JobAttempt, python: str) -> list[str]:
    """Return the command of each rank.

    Parameters
    ----------
    attempt : JobAttempt
    python : str
        The interpreter.

    Returns
    -------
    list of str
    """
    # -P: a folder with the name of a package, where the service was started, must not be imported instead.
    return [python, "-P", "-m", "api.worker.background", str(attempt.memory), *attempt.arguments]
