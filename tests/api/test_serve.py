"""`ensemble serve` as a process: it runs jobs, refuses unsafe settings and leaves no process behind."""

from __future__ import annotations

import asyncio
import errno
import os
import signal
import socket
import subprocess
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx2
import psutil
import pytest
from fastapi import APIRouter

from api.auth import TokenScope
from tests.api.processes import alive, wait_until
from tests.api.servers import make_token, serving
from tests.api.services import service

SECONDS = 600
SECONDS_TO_DIE = 60  # far less on a machine that has nothing else to do

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


def simulating(family: list[psutil.Process]) -> list[psutil.Process]:
    """Return the processes that belong to a job."""
    return [process for process in family if "bisect" in process.cmdline()]


@pytest.mark.long
def test_a_study_is_traced_and_its_boundary_is_stored(ensemble, store):
    with service(store) as server, httpx2.Client(base_url=server.url, timeout=SECONDS) as client:
        assert "There are no tokens" in server.logged()
        job = client.post("/jobs", json=QUICK_STUDY).json()
        with client.stream("GET", f"/jobs/{job['id']}/events") as events:
            assert "succeeded" in list(events.iter_lines())[-2]
        done = client.get(f"/jobs/{job['id']}").json()
        assert (done["status"], done["progress"], done["attempts"]) == ("succeeded", 100, 1)
        boundary = client.get(f"/boundaries/{job['key']}").json()
        (point,) = boundary["points"]
        assert point["status"] == "converged"
        at = client.get(f"/boundaries/{job['key']}/at", params={"flow.rate": 0.5}).json()
        assert at["uncertainty"] == point["bracket"]
        runs = {run["key"] for run in client.get("/runs").json()["items"]}
        assert runs == set(point["runs"])
    # The command line reads the same store.
    listed = ensemble("query", "boundaries", f"--store={store}")
    assert job["key"] in listed.stdout


def test_a_request_that_the_end_of_the_server_cuts_off_may_be_sent_again(store, monkeypatch):
    monkeypatch.setattr("api.serve.DRAIN_SECONDS", 1)
    router, begun = APIRouter(), threading.Event()

    @router.get("/endless")
    async def endless() -> None:
        begun.set()
        await asyncio.sleep(SECONDS)

    with ThreadPoolExecutor(1) as pool:
        with serving(store, [router]) as address:
            asked = pool.submit(httpx2.get, f"{address}/endless", timeout=SECONDS)
            assert begun.wait(SECONDS)
        answer = asked.result()
    assert (answer.status_code, answer.json()["detail"]) == (503, "the server stops")
    assert answer.headers["retry-after"]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_no_process_is_left_however_the_server_ends(store, number):
    endless = {"preset": "critical-hamaker", "set": {"search.tolerance": 1e-6}, "ranks": 2}
    with service(store) as server, httpx2.Client(base_url=server.url, timeout=SECONDS) as client:
        job = client.post("/jobs", json=endless).json()
        wait_until(lambda: len(simulating(server.family())) >= 2)
        family = server.family()
        with client.stream("GET", f"/jobs/{job['id']}/events"):
            os.kill(server.process.pid, number)
            server.process.wait(SECONDS)
        wait_until(lambda: not alive(family), SECONDS_TO_DIE)
        assert "Traceback" not in server.logged()
        if number != signal.SIGKILL:
            assert server.process.returncode == 0
            assert "go on when the service is started again" in server.logged()
    with service(store, "--workers=0") as again:
        unfinished = httpx2.get(f"{again.url}/jobs/{job['id']}").json()
        assert not unfinished["finished"], "a worker can continue it"


def test_a_worker_that_dies_is_replaced(store):
    with service(store) as server:
        (worker,) = wait_until(server.children)
        worker.kill()
        (another,) = wait_until(lambda: [child for child in server.children() if child != worker])
        assert another.is_running()
        assert httpx2.get(f"{server.url}/healthz").status_code == 200


@pytest.mark.parametrize("workers", [0, 2])
def test_the_number_of_workers_is_an_option(store, workers):
    with service(store, f"--workers={workers}") as server:
        wait_until(lambda: len(server.children()) == workers)


@pytest.fixture
def refused(ensemble: Callable[..., subprocess.CompletedProcess[str]]) -> Callable[..., str]:
    """Return the message of a server that refuses to start."""

    def message(store: Path, *options: str) -> str:
        result = ensemble("serve", "--port=0", f"--store={store}", *options)
        assert result.returncode == 2
        assert len(result.stderr.strip().splitlines()) == 1, result.stderr
        return result.stderr

    return message


def test_another_address_needs_tokens(refused, store):
    message = refused(store, "--host=0.0.0.0")
    assert "0.0.0.0" in message
    assert "ensemble token create" in message
    token = make_token(store, "ada", TokenScope.READ)
    with service(store, "--host=0.0.0.0", "--workers=0") as server:
        assert "There are no tokens" not in server.logged()
        assert httpx2.get(f"{server.url}/jobs").status_code == 401
        headers = {"Authorization": f"Bearer {token}"}
        assert httpx2.get(f"{server.url}/jobs", headers=headers).status_code == 200


def has_address(host: str) -> bool:
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
        return probe.connect_ex((host, 9)) in (0, errno.ECONNREFUSED)


@pytest.mark.parametrize("host", ["127.0.0.2", "::1"])
def test_every_loopback_address_serves_this_machine_without_tokens(store, host):
    if not has_address(host):
        pytest.skip(f"this machine has no {host}")
    with service(store, f"--host={host}", "--workers=0") as server:
        assert httpx2.get(f"{server.url}/runs").status_code == 200
        assert httpx2.post(f"{server.url}/estimate", json={"preset": "doublet-shear"}).status_code == 200
        origin = {"Origin": server.url}
        assert httpx2.get(f"{server.url}/runs", headers=origin).status_code == 200
        elsewhere = {"Origin": "http://evil.example"}
        assert httpx2.get(f"{server.url}/runs", headers=elsewhere).status_code == 403
        named = httpx2.get(f"{server.url}/runs", headers={"Host": "evil.example"})
        assert named.status_code == 421
        assert "loopback" in named.json()["detail"]


def test_settings_come_from_the_environment_and_are_checked(refused, store, monkeypatch):
    monkeypatch.setenv("ENSEMBLE_MAXIMUM_RANKS", "none")
    assert "ENSEMBLE_MAXIMUM_RANKS" in refused(store)
    monkeypatch.setenv("ENSEMBLE_MAXIMUM_RANKS", "1")
    monkeypatch.setenv("ENSEMBLE_REQUEST_RATE", "often")
    assert "ENSEMBLE_REQUEST_RATE" in refused(store)
    monkeypatch.delenv("ENSEMBLE_REQUEST_RATE")
    with service(store, "--workers=0") as server:
        answer = httpx2.post(f"{server.url}/jobs", json={"preset": "doublet-shear", "ranks": 2})
        assert answer.status_code == 422
        assert "at most 1" in answer.json()["detail"]


def test_a_launcher_that_cannot_be_used_is_refused(refused, store, monkeypatch):
    monkeypatch.setenv("ENSEMBLE_LAUNCHER", "rsh")
    assert "ENSEMBLE_LAUNCHER" in refused(store)
    monkeypatch.setenv("ENSEMBLE_LAUNCHER", "slurm")
    monkeypatch.setenv("PATH", "/nonexistent")
    assert "sbatch" in refused(store)


def test_a_directory_that_is_not_a_store_is_refused(refused, tmp_path):
    directory = tmp_path / "precious"
    directory.mkdir()
    (directory / "data").write_text("precious")
    assert "precious" in refused(directory)
    assert [entry.name for entry in directory.iterdir()] == ["data"]
