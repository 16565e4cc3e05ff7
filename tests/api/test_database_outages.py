"""A service whose PostgreSQL server is away answers with 503, and goes on by itself afterwards."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from pathlib import Path

import httpx
import psutil
import pytest
from sqlalchemy import make_url
from sqlalchemy.exc import OperationalError

from ensemble.store import Store
from ensemble.store.sql_database import engine
from tests import postgresql
from tests.api.processes import wait_until
from tests.api.servers import client_of

PATIENCE = 60.0  # seconds after which a request counts as never answered
WORK = {"preset": "doublet-shear"}


@pytest.fixture
def own_server() -> Iterator[postgresql.Server]:
    """A server that a test may stop; costs 3 s."""
    programs = postgresql.programs()
    if programs is None:
        pytest.skip("PostgreSQL is not installed")
    with postgresql.running(programs) as server:
        yield server


@pytest.fixture
def served(
    own_server: postgresql.Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[httpx.Client]:
    """A client of a service with its catalog, jobs and tokens on that server."""
    monkeypatch.setenv("ENSEMBLE_DATABASE", own_server.new_database())
    Store.open(tmp_path / "store").close()
    with client_of(tmp_path / "store") as client:
        client.timeout = httpx.Timeout(PATIENCE)
        yield client


@contextmanager
def frozen(server: postgresql.Server) -> Iterator[None]:
    """Stop all processes of a server by a signal, and let them go on."""
    assert server.process is not None
    main = psutil.Process(server.process.pid)
    processes = [main, *main.children(recursive=True)]
    for process in processes:
        process.suspend()
    try:
        yield
    finally:
        for process in processes:
            process.resume()


def answers(client: httpx.Client) -> dict[str, httpx.Response]:
    """What each kind of request is answered with."""
    asked = ("/readyz", "/jobs", "/runs", "/boundaries", "/metrics", f"/jobs/{'0' * 8}", "/jobs/0/events")
    return {path: client.get(path) for path in asked} | {"POST": client.post("/jobs", json=WORK)}


def refused(client: httpx.Client) -> None:
    """Check that every request is told to come again later."""
    for name, answer in answers(client).items():
        assert answer.status_code == HTTPStatus.SERVICE_UNAVAILABLE, f"{name}: {answer.text}"
        assert answer.headers["retry-after"], name


def test_a_stopped_server_is_not_ready(served: httpx.Client, own_server: postgresql.Server) -> None:
    # Costs 5 s.
    assert served.post("/jobs", json=WORK).status_code == HTTPStatus.ACCEPTED
    own_server.stop()
    try:
        refused(served)
    finally:
        own_server.start()
    assert served.get("/readyz").status_code == HTTPStatus.OK
    assert served.post("/jobs", json=WORK).status_code == HTTPStatus.ACCEPTED


def test_a_server_that_says_nothing_is_not_waited_for(
    served: httpx.Client, own_server: postgresql.Server
) -> None:
    # Costs 4 s of processor time; waits for two minutes at most.
    assert served.post("/jobs", json=WORK).status_code == HTTPStatus.ACCEPTED
    with frozen(own_server):
        for path in ("/readyz", "/jobs"):
            assert served.get(path).status_code == HTTPStatus.SERVICE_UNAVAILABLE, path
        assert served.post("/jobs", json=WORK).status_code == HTTPStatus.SERVICE_UNAVAILABLE
        assert served.get("/healthz").status_code == HTTPStatus.OK
    wait_until(lambda: served.get("/readyz").status_code == HTTPStatus.OK)
    assert served.post("/jobs", json=WORK).status_code == HTTPStatus.ACCEPTED


def test_a_stream_of_events_goes_on_after_an_outage(
    served: httpx.Client, own_server: postgresql.Server
) -> None:
    # Costs 5 s.
    job = served.post("/jobs", json=WORK).json()["id"]
    lines: list[str] = []
    with served.stream("GET", f"/jobs/{job}/events") as stream:
        listener = threading.Thread(target=_collect, args=(stream, lines))
        listener.start()
        wait_until(lambda: any(line.startswith("data:") for line in lines))
        own_server.stop()
        wait_until(lambda: any(line.startswith(": the database") for line in lines))
        own_server.start()
        assert wait_until(lambda: served.delete(f"/jobs/{job}").status_code == HTTPStatus.OK)
        listener.join()
    assert any('"dismissed"' in line for line in lines[-4:])


def _collect(stream: httpx.Response, lines: list[str]) -> None:
    for line in stream.iter_lines():
        lines.append(line)


def test_a_host_that_drops_packets_is_given_up() -> None:
    # Costs nothing but seconds: a listener whose queue is full lets later connections wait for ever.
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen(0)
        port = silent.getsockname()[1]
        made = engine(f"postgresql+psycopg://nobody@127.0.0.1:{port}/nothing")
        with pytest.raises(OperationalError, match="timeout"):
            made.connect()


def test_what_the_url_says_of_connections_counts() -> None:
    made = engine("postgresql+psycopg://nobody@127.0.0.1/nothing?connect_timeout=33")
    _, options = made.dialect.create_connect_args(make_url(str(made.url)))
    assert options["connect_timeout"] == "33"
