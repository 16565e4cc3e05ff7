"""The service as users start it: `ensemble serve` in a process of its own, with workers beside it."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

import psutil

from tests.api.processes import alive, wait_until

SERVE = (sys.executable, "-m", "ensemble", "serve")
SECONDS_TO_STOP = 30
_ADDRESS = re.compile(r"running on (http://\S+:(\d+))")


@dataclass(frozen=True)
class StartedService:
    """A service that answers, and the file with everything that it has logged."""

    process: subprocess.Popen[bytes]
    url: str
    port: int
    log: Path

    def logged(self) -> str:
        """Return what the service has logged so far."""
        return self.log.read_text(encoding="utf-8")

    def children(self) -> list[psutil.Process]:
        """Return the workers."""
        return psutil.Process(self.process.pid).children()

    def family(self) -> list[psutil.Process]:
        """Return the server and all its descendants."""
        server = psutil.Process(self.process.pid)
        return [server, *server.children(recursive=True)]

    def kill(self) -> None:
        """Kill the server without giving it time to stop its workers."""
        self.process.kill()
        self.process.wait()

    def stop(self) -> None:
        """Stop the service as a user does; kill what has not stopped in time."""
        if self.process.poll() is not None:
            return
        family = self.family()
        self.process.terminate()
        try:
            self.process.wait(SECONDS_TO_STOP)
        except subprocess.TimeoutExpired:
            for member in alive(family):
                with suppress(psutil.NoSuchProcess):
                    member.kill()
            self.process.wait()
            raise


def start_service(store: Path, *options: str, port: int = 0) -> StartedService:
    """Run `ensemble serve` with these options, and return when it answers."""
    log = store.with_name(f"service-{uuid4().hex}.log")
    with log.open("wb") as output:
        process = subprocess.Popen(
            [*SERVE, f"--port={port}", f"--store={store}", *options],
            stdout=output,
            stderr=output,
            start_new_session=True,
        )

    def address() -> re.Match[str] | None:
        assert process.poll() is None, log.read_text(encoding="utf-8")
        return _ADDRESS.search(log.read_text(encoding="utf-8"))

    found = wait_until(address)
    return StartedService(process, found[1], int(found[2]), log)


@contextmanager
def service(store: Path, *options: str, port: int = 0) -> Iterator[StartedService]:
    """Run `ensemble serve` with these options as long as the block runs."""
    started = start_service(store, *options, port=port)
    try:
        yield started
    finally:
        started.stop()
