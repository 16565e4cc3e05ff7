"""The processes of a launched job."""

from __future__ import annotations

import subprocess
from contextlib import suppress

import psutil


def ranks_of(launched: subprocess.Popen[str]) -> dict[int, psutil.Process]:
    """Return the ranks that run, by their numbers."""
    found = {}
    for process in psutil.Process(launched.pid).children(recursive=True):
        with suppress(psutil.NoSuchProcess):  # one that has just ended is none of them
            environment = process.environ()
            if "PMI_RANK" in environment and "ensemble" in process.cmdline():
                found[int(environment["PMI_RANK"])] = process
    return found
