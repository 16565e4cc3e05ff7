"""What starts the ranks of a job: one module for each launcher, registered here by its name."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from api.settings import Settings
from api.worker.launchers.launcher import Launcher
from api.worker.launchers.mpirun import Mpirun
from api.worker.launchers.slurm import Slurm

LAUNCHERS: Mapping[str, Callable[[Settings], Launcher]] = {
    "mpirun": lambda settings: Mpirun(),
    "slurm": lambda settings: Slurm(settings.slurm_options),
}
