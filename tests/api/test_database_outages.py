"""A service whose PostgreSQL server is away answers with 503, and goes on by itself afterwards."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from http import HTTPStatus
from pathlib import Path

import httpx2
import pytest
from sqlalchemy import make_url, text
from sqlalchemy.exc import OperationalError

from api.database.service_database import Database
from api.jobs.job_queue import Jobs
from ensemble.questions import preset_question
from ensemble.store import Store, silent_servers
from ensemble.store.sql_database import CONNECTING, engine
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
) -> Iterator[httpx2.Client]:
    """A client of a service with its catalog, jobs and tokens on that server."""
    monkeypatch.setenv("ENSEMBLE_DATABASE", own_server.new_database())
    Store.open(tmp_path / "store").close()
    with client_of(tmp_path / "store") as client:
        client.timeout = httpx2.Timeout(PATIENCE)
        yield client


def answers(client: httpx2.Client) -> dict[str, httpx2.Response]:
    """What each kind of request is answered with."""
    asked = ("/readyz", "/jobs", "/runs", "/boundaries", "/metrics", f"/jobs/{'0' * 8}", "/jobs/0/events")
    return {path: client.get(path) for path in asked} | {"POST": client.post("/jobs", json=WORK)}


def refused(client: httpx2.Client) -> None:
    """Check that every request is told to come again later."""
    for name, answer in answers(client).items():
        assert answer.status_code == HTTPStatus.SERVICE_UNAVAILABLE, f"{name}: {answer.text}"
        assert answer.headers["retry-after"], name


def test_a_stopped_server_is_not_ready(served: httpx2.Client, own_server: postgresql.Server) -> None:
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
    served: httpx2.Client, own_server: postgresql.Server
) -> None:
    # Costs 4 s of processor time; waits for two minutes at most.
    assert served.post("/jobs", json=WORK).status_code == HTTPStatus.ACCEPTED
    with own_server.suspended():
        for path in ("/readyz", "/jobs"):
            assert served.get(path).status_code == HTTPStatus.SERVICE_UNAVAILABLE, path
        assert served.post("/jobs", json=WORK).status_code == HTTPStatus.SERVICE_UNAVAILABLE
        assert served.get("/healthz").status_code == HTTPStatus.OK
    wait_until(lambda: served.get("/readyz").status_code == HTTPStatus.OK)
    assert served.post("/jobs", json=WORK).status_code == HTTPStatus.ACCEPTED


def test_a_stream_of_events_goes_on_after_an_outage(
    served: httpx2.Client, own_server: postgresql.Server
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


def _collect(stream: httpx2.Response, lines: list[str]) -> None:
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


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Servers are asked soon whether they live."""
    monkeypatch.setattr(silent_servers, "SILENT_SECONDS", 0.2)
    monkeypatch.setitem(CONNECTING, "connect_timeout", 2)


@pytest.mark.usefixtures("impatient")
def test_a_statement_is_given_up_whose_server_falls_silent(own_server: postgresql.Server) -> None:
    made = engine(own_server.new_database())
    with made.connect() as connection:
        with own_server.suspended(), pytest.raises(OperationalError, match="does not answer"):
            connection.execute(text("SELECT 1"))
        assert connection.invalidated
    with made.connect() as connection:
        assert connection.scalar(text("SELECT 1")) == 1


@pytest.mark.usefixtures("impatient")
def test_a_commit_is_given_up_whose_server_falls_silent(own_server: postgresql.Server) -> None:
    made = engine(own_server.new_database())
    with made.connect() as connection:
        connection.execute(text("CREATE TABLE numbers (number integer)"))
        with own_server.suspended(), pytest.raises(OperationalError, match="does not answer"):
            connection.commit()


@pytest.mark.usefixtures("impatient")
def test_a_statement_may_take_long(own_server: postgresql.Server) -> None:
    made = engine(own_server.new_database())
    with made.connect() as connection:
        assert connection.scalar(text("SELECT 7 FROM pg_sleep(1.5)")) == 7


@pytest.mark.usefixtures("impatient")
def test_a_worker_does_not_wait_for_a_silent_server(own_server: postgresql.Server, tmp_path: Path) -> None:
    with Database.open(own_server.new_database(), tmp_path) as database:
        jobs = Jobs(database, tmp_path)
        jobs.result(jobs.submit(preset_question("doublet-shear", {}), "ada", 1, 60.0))
        lease = jobs.lease("worker")
        assert lease is not None
        with own_server.suspended(), pytest.raises(OperationalError):
            jobs.heartbeat(lease, 1, "goes on")
        assert jobs.heartbeat(lease, 2, "goes on")
