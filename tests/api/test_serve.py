"""`ensemble serve` as a process: it starts, runs jobs, refuses what is unsafe, and leaves nothing behind."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import psutil
import pytest

from api.auth import TokenScope
from tests.api.servers import make_token

SERVE = (sys.executable, "-m", "ensemble", "serve")
SECONDS = 60
SECONDS_TO_DIE = 5

QUICK_STUDY: dict[str, Any] = {
    "preset": "critical-hamaker",
    "set": {
        "sweep.values": [0.5],
        "search.tolerance": 0.2,
        "scene.numerics.points": 32,
        "scene.numerics.tolerance": 1e-3,
    },
    "ranks": 2,
}


def until(condition: Callable[[], Any], seconds: float = SECONDS) -> Any:
    """Wait for something to be true and return it."""
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < deadline, "it did not come true"
        time.sleep(0.05)
    return found


@dataclass(frozen=True)
class Served:
    """A server's process, what it has said and how to talk to it."""

    process: subprocess.Popen[bytes]
    said: Path
    client: httpx.Client

    def family(self) -> list[psutil.Process]:
        """The server and all that it has started."""
        server = psutil.Process(self.process.pid)
        return [server, *server.children(recursive=True)]


@contextmanager
def served(store: Path, *options: str) -> Iterator[Served]:
    """Start a server at a free port; whatever is left of it in the end is killed."""
    said = store.with_name("said")
    with said.open("wb") as log:
        process = subprocess.Popen(
            [*SERVE, "--port=0", f"--store={store}", *options], stdout=log, stderr=log, start_new_session=True
        )
    family: list[psutil.Process] = []
    try:
        address = until(lambda: re.search(r"running on (http://\S+)", said.read_text(encoding="utf-8")))[1]
        with httpx.Client(base_url=address, timeout=SECONDS) as client:
            yield Served(process, said, client)
    finally:
        if process.poll() is None:
            family = psutil.Process(process.pid).children(recursive=True)
            process.kill()
        process.wait()
        for member in family:
            try:
                member.kill()
            except psutil.NoSuchProcess:
                continue


def simulating(family: list[psutil.Process]) -> list[psutil.Process]:
    """Those of the processes that belong to a job."""
    found = []
    for process in family:
        try:
            if "bisect" in process.cmdline():
                found.append(process)
        except psutil.NoSuchProcess:
            continue
    return found


def gone(family: list[psutil.Process]) -> bool:
    return not [process for process in family if process.is_running() and process.status() != "zombie"]


def test_a_study_is_traced_and_its_boundary_is_there(ensemble, store):
    with served(store) as server:
        assert "There are no tokens" in server.said.read_text(encoding="utf-8")
        job = server.client.post("/jobs", json=QUICK_STUDY).json()
        with server.client.stream("GET", f"/jobs/{job['id']}/events") as events:
            assert "succeeded" in list(events.iter_lines())[-2]
        done = server.client.get(f"/jobs/{job['id']}").json()
        assert (done["status"], done["progress"], done["attempts"]) == ("succeeded", 100, 1)
        boundary = server.client.get(f"/boundaries/{job['key']}").json()
        (point,) = boundary["points"]
        assert point["status"] == "converged"
        at = server.client.get(f"/boundaries/{job['key']}/at", params={"flow.rate": 0.5}).json()
        assert at["uncertainty"] == point["bracket"]
        runs = {run["key"] for run in server.client.get("/runs").json()["items"]}
        assert runs == set(point["runs"])
    # The command line has the same store.
    listed = ensemble("query", "boundaries", f"--store={store}")
    assert job["key"] in listed.stdout


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_however_it_ends_nothing_is_left(store, number):
    endless = {"preset": "critical-hamaker", "set": {"search.tolerance": 1e-6}, "ranks": 2}
    with served(store) as server:
        job = server.client.post("/jobs", json=endless).json()
        until(lambda: len(simulating(server.family())) >= 2)
        family = server.family()
        with server.client.stream("GET", f"/jobs/{job['id']}/events", timeout=SECONDS):
            os.kill(server.process.pid, number)
            server.process.wait(SECONDS)
        until(lambda: gone(family), SECONDS_TO_DIE)
        assert "Traceback" not in server.said.read_text(encoding="utf-8")
    with served(store, "--workers=0") as again:
        assert not again.client.get(f"/jobs/{job['id']}").json()["finished"], "it goes on when somebody works"


def test_a_worker_that_dies_is_replaced(store):
    with served(store) as server:
        (worker,) = until(lambda: psutil.Process(server.process.pid).children())
        worker.kill()
        (another,) = until(
            lambda: [child for child in psutil.Process(server.process.pid).children() if child != worker]
        )
        assert another.is_running()
        assert server.client.get("/healthz").status_code == 200


@pytest.mark.parametrize("workers", [0, 2])
def test_as_many_workers_as_asked_for(store, workers):
    with served(store, f"--workers={workers}") as server:
        until(lambda: len(psutil.Process(server.process.pid).children()) == workers)


def refused(store: Path, *options: str) -> str:
    result = subprocess.run(
        [*SERVE, "--port=0", f"--store={store}", *options],
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    assert result.returncode == 2
    assert len(result.stderr.strip().splitlines()) == 1, result.stderr
    return result.stderr


def test_another_address_needs_tokens(store):
    message = refused(store, "--host=0.0.0.0")
    assert "0.0.0.0" in message
    assert "ensemble token create" in message
    token = make_token(store, "ada", TokenScope.READ)
    with served(store, "--host=0.0.0.0", "--workers=0") as server:
        assert "There are no tokens" not in server.said.read_text(encoding="utf-8")
        port = server.client.base_url.port
        assert httpx.get(f"http://127.0.0.1:{port}/jobs").status_code == 401
        headers = {"Authorization": f"Bearer {token}"}
        assert httpx.get(f"http://127.0.0.1:{port}/jobs", headers=headers).status_code == 200


def test_settings_come_from_the_environment_and_are_checked(store, monkeypatch):
    monkeypatch.setenv("ENSEMBLE_MAXIMUM_RANKS", "none")
    assert "ENSEMBLE_MAXIMUM_RANKS" in refused(store)
    monkeypatch.setenv("ENSEMBLE_MAXIMUM_RANKS", "1")
    monkeypatch.setenv("ENSEMBLE_REQUEST_RATE", "often")
    assert "ENSEMBLE_REQUEST_RATE" in refused(store)
    monkeypatch.delenv("ENSEMBLE_REQUEST_RATE")
    with served(store, "--workers=0") as server:
        answer = server.client.post("/jobs", json={"preset": "doublet-shear", "ranks": 2})
        assert answer.status_code == 422
        assert "at most 1" in answer.json()["detail"]


def test_a_store_that_is_none_is_refused(tmp_path):
    place = tmp_path / "precious"
    place.mkdir()
    (place / "data").write_text("precious")
    assert "precious" in refused(place)
    assert [entry.name for entry in place.iterdir()] == ["data"]
