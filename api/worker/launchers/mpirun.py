"""Ranks on this machine, or within an allocation of a cluster that `mpirun` knows of."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from api.worker.launchers.launcher import JobAttempt, rank_command
from ensemble.errors import BadInput


class Mpirun:
    """Starts ranks with `mpirun`; see `Launcher`.

    Raises
    ------
    BadInput
        If there is no `mpirun`.
    """

    limits_time = False

    def __init__(self) -> None:
        beside = Path(sys.executable).with_name("mpirun")
        mpirun = str(beside) if beside.exists() else shutil.which("mpirun")
        if mpirun is None:
            raise BadInput("mpirun: there is none on the PATH (the extra 'mpich' brings one)")
        self._mpirun = mpirun

    def command(self, attempt: JobAttempt) -> list[str]:
        """Return the command of the launcher.

        Parameters
        ----------
        attempt : JobAttempt

        Returns
        -------
        list of str
        """
        return [self._mpirun, "-n", str(attempt.ranks), *rank_command(attempt, sys.executable)]

    def end(self, attempt: JobAttempt) -> None:
        """Do nothing: all ranks are descendants of the command.

        Parameters
        ----------
        attempt : JobAttempt
        """
