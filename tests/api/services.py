"""The service as users start it: a process of its own with a worker beside it."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

STARTED = re.compile(r"running on http://127\.0\.0\.1:(\d+)")


@dataclass(frozen=True)
class Started:
    """A service that answers; `log` holds what it says after its address."""

    process: subprocess.Popen[str]
    port: int

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"


def start_service(store: Path, log: Path, port: int = 0, workers: int = 1) -> Started:
    """Run `ensemble serve`, and return when it answers."""
    command = [sys.executable, "-m", "ensemble", "serve", "--store", str(store)]
    with log.open("w") as output:
        process = subprocess.Popen(
            [*command, "--port", str(port), "--workers", str(workers)], stderr=output, text=True
        )
    while (found := STARTED.search(log.read_text())) is None:
        assert process.poll() is None, log.read_text()
        time.sleep(0.05)
    return Started(process, int(found[1]))


@contextmanager
def service(store: Path, log: Path, port: int = 0, workers: int = 1) -> Iterator[Started]:
    """Run the service, and end it as a user does."""
    started = start_service(store, log, port, workers)
    try:
        yield started
    finally:
        started.process.terminate()
        started.process.wait()
