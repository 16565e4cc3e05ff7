"""A PostgreSQL server of the tests' own, from the system's package."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

import psutil
from sqlalchemy import URL

ROOT = 0
SECONDS_TO_START = 120


@dataclass
class Server:
    """A server, reached by a socket in its directory.  It refuses to run as root."""

    programs: Path
    directory: Path
    user: str | None
    process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it, and return when it answers."""
        self.process = subprocess.Popen(
            [self.programs / "postgres", "-D", self.data, "-k", self.directory, "-c", "listen_addresses="],
            user=self.user,
            cwd=self.directory,
            stderr=subprocess.DEVNULL,
        )
        _wait_until_ready(self, self.process)

    def stop(self) -> None:
        """Stop it, whoever is connected."""
        if self.process is not None:
            self.process.send_signal(signal.SIGINT)
            self.process.wait()

    @contextmanager
    def suspended(self) -> Iterator[None]:
        """Let it say nothing, to new connections and to open ones, as long as the block runs."""
        assert self.process is not None
        main = psutil.Process(self.process.pid)
        main.suspend()  # first, so that it starts no others
        suspended = [main]
        for process in main.children(recursive=True):
            with suppress(psutil.NoSuchProcess):
                process.suspend()
                suspended.append(process)
        try:
            yield
        finally:
            for process in reversed(suspended):
                with suppress(psutil.NoSuchProcess):  # it had ended, and only waited to be noticed
                    process.resume()

    @property
    def data(self) -> Path:
        return self.directory / "data"

    def run(self, program: str, *arguments: str) -> None:
        subprocess.run(
            [self.programs / program, *arguments],
            user=self.user,
            cwd=self.directory,
            check=True,
            capture_output=True,
        )

    def new_database(self) -> str:
        """Make an empty database and return its URL."""
        name = f"test_{uuid4().hex}"
        self.run("createdb", "--host", str(self.directory), "--username=tests", name)
        query = {"host": str(self.directory)}
        return URL.create("postgresql+psycopg", "tests", database=name, query=query).render_as_string()


def programs() -> Path | None:
    """Directory of the server's programs, which Debian keeps off the PATH."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb")) or [shutil.which("initdb")]
    return Path(found[-1]).parent if found[-1] else None


@contextmanager
def running(programs: Path) -> Iterator[Server]:
    """Run a server."""
    user = "postgres" if os.geteuid() == ROOT else None
    # Not in pytest's directory, which only its owner may enter.
    directory = Path(tempfile.mkdtemp(prefix="postgresql-"))
    try:
        if user is not None:
            shutil.chown(directory, user)
        server = Server(programs, directory, user)
        server.run("initdb", "--pgdata", str(server.data), "--username=tests", "--auth=trust")
        try:
            server.start()
            yield server
        finally:
            server.stop()
    finally:
        shutil.rmtree(directory)


def _wait_until_ready(server: Server, process: subprocess.Popen[bytes]) -> None:
    deadline = time.monotonic() + SECONDS_TO_START
    while subprocess.run([server.programs / "pg_isready", "-q", "-h", server.directory]).returncode != 0:
        assert process.poll() is None, "the server ended"
        assert time.monotonic() < deadline, "the server did not start"
        time.sleep(0.05)
