"""The Python client against a real service."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import timedelta
from pathlib import Path

import httpx2
import numpy as np
import pytest

from api.auth import TokenScope
from api.client import Client, Refused
from api.jobs.job import Job, JobStatus
from ensemble.config.documents import load_scene, load_study
from ensemble.store import Store
from solver.analysis.run import Outcome
from solver.membrane.curve import positions
from tests.api.processes import working
from tests.api.servers import make_token, serving
from tests.api.services import service, start_service
from tests.api.stores import FRAMES, RATES, SWEEP, critical, example_boundary

SHORT = {"horizon": 4.0}  # a fraction of a second to simulate


@pytest.fixture(scope="module")
def reader(filled_store: Path) -> Iterator[Client]:
    """A client of the filled store."""
    with serving(filled_store) as url, Client(url) as client:
        yield client


@pytest.fixture
def submitter(tmp_path: Path) -> Iterator[Client]:
    """A client of a new store without workers."""
    with serving(tmp_path / "store") as url, Client(url) as client:
        yield client


def test_a_submitted_scene_is_waited_for_and_read(tmp_path: Path) -> None:
    store = tmp_path / "store"
    states: list[Job] = []
    with serving(store) as url, working(store), Client(url) as client:
        job = client.wait(client.submit("doublet-shear", SHORT), states.append)
        run = client.run(job.key)
        data = run.to_xarray()
    assert job.status is JobStatus.SUCCEEDED
    assert states[-1] == job
    assert [state.progress for state in states] == sorted(state.progress for state in states)
    with Store.existing(store) as opened:
        stored = opened.load(job.key)
    assert run.summary.outcome == stored.outcome == Outcome.UNDECIDED
    np.testing.assert_array_equal(data["gap"], stored.series["gap"])
    np.testing.assert_array_equal(data["time"], stored.series["time"])
    length = np.array([vesicle.length for vesicle in stored.scene.vesicles])
    expected = positions(stored.frames.tangent_angle, stored.frames.center, length)
    # Frames come as float32.
    np.testing.assert_allclose(
        data["position"].transpose("frame_time", "vesicle", "axis", "point"), expected, rtol=2e-7, atol=2e-6
    )
    np.testing.assert_allclose(data["tension"], stored.frames.tension, rtol=2e-7)


def test_a_boundary_as_a_data_set(reader: Client) -> None:
    (boundary,) = reader.boundaries()
    assert boundary == reader.boundary(boundary.study_key)
    data = reader.boundary(boundary.study_key).to_xarray()
    known = data.sel({"flow.rate": list(SWEEP)})
    np.testing.assert_allclose(known["critical_value"], [critical(rate) for rate in SWEEP], rtol=1e-12)
    np.testing.assert_array_equal(known["outcome"], [["separated", "bound"]] * len(SWEEP))
    searched = data.sel({"flow.rate": 2.0})
    assert searched["bracket"].sel(side="low") == 0.5
    assert np.isnan(searched["bracket"].sel(side="high"))
    assert np.isnan(searched["critical_value"])
    assert searched["outcome"].sel(side="high") == ""
    assert data.attrs["parameter"] == "adhesion.hamaker"


def test_a_critical_value_between_points(reader: Client) -> None:
    key = example_boundary().study_key
    found = reader.critical_value(key, {"flow.rate": 0.75})
    low, high = found.uncertainty
    assert low < critical(0.75) < high
    with pytest.raises(Refused, match=r"flow\.rate: 9 — must lie within"):
        reader.critical_value(key, {"flow.rate": 9})


def test_runs_by_conditions(reader: Client) -> None:
    bound = list(reader.runs("outcome=bound", "flow.rate>=0.75"))
    assert [run.summary.scene.flow.rate for run in bound if run.summary.scene.flow] == list(RATES[:1:-1])
    assert all(run.to_xarray().sizes["frame_time"] == FRAMES for run in bound)


def test_a_collection_longer_than_a_page(submitter: Client) -> None:
    submitted = [submitter.submit("vesicle-shear", {"flow.rate": 1 + number}).id for number in range(3)]
    assert [job["id"] for job in submitter._items("/jobs", {"limit": 1})] == submitted[::-1]
    assert [job.id for job in submitter.jobs()] == submitted[::-1]


def test_studies_and_scenes_are_submitted_as_models(submitter: Client) -> None:
    study, scene = load_study("critical-hamaker"), load_scene("doublet-trap")
    assert submitter.submit(study).key == study.key
    assert submitter.submit(scene).name == "scene"
    assert submitter.estimate(study) == submitter.estimate("critical-hamaker")
    assert submitter.estimate(study, {"sweep.values": [0.5]}).runs < submitter.estimate(study).runs


def test_a_refusal_names_the_field(submitter: Client) -> None:
    with pytest.raises(Refused, match=r"numerics\.points: 31") as refusal:
        submitter.submit("doublet-shear", {"numerics.points": 31})
    assert refusal.value.status == 422
    assert not list(submitter.jobs())


def test_waiting_ends_when_the_job_is_dismissed(submitter: Client) -> None:
    job = submitter.submit("doublet-shear")
    timer = threading.Timer(0.3, lambda: submitter.dismiss(job))
    timer.start()
    assert submitter.wait(job).status is JobStatus.DISMISSED
    timer.join()


def test_a_client_with_a_token(tmp_path: Path) -> None:
    store = tmp_path / "store"
    Store.open(store).close()
    token = make_token(store, "ada", TokenScope.SUBMIT, timedelta(hours=1))
    with serving(store) as url:
        with Client(url) as client, pytest.raises(Refused) as refusal:
            client.submit("vesicle-shear")
        assert refusal.value.status == 401
        with Client(url, token) as client:
            assert client.submit("vesicle-shear").owner == "ada"


@contextmanager
def losing_the_first_answer(port: int) -> Iterator[str]:
    """Forward requests to a port of this machine, and drop the connection when the first answer arrives."""
    lost = threading.Event()

    def carry(client: socket.socket) -> None:
        with client, socket.create_connection(("127.0.0.1", port)) as server:
            requests = threading.Thread(target=pass_on, args=(client, server), daemon=True)
            requests.start()
            if lost.is_set():
                pass_on(server, client)
            else:
                server.recv(1)
                lost.set()
                client.shutdown(socket.SHUT_RDWR)

    def pass_on(source: socket.socket, target: socket.socket) -> None:
        with suppress(OSError):
            while (octets := source.recv(1 << 20)) != b"":
                target.sendall(octets)

    def accept() -> None:
        with listener:
            for _ in range(2):
                client, _ = listener.accept()
                carry(client)

    listener = socket.create_server(("127.0.0.1", 0))
    thread = threading.Thread(target=accept, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    assert lost.is_set()


def test_a_request_whose_answer_is_lost_makes_one_job(tmp_path: Path) -> None:
    with serving(tmp_path / "store") as url, Client(url) as direct:
        port = int(url.rsplit(":", 1)[1])
        with losing_the_first_answer(port) as unreliable, Client(unreliable) as client:
            job = client.submit("vesicle-shear")
        assert [known.id for known in direct.jobs()] == [job.id]


def test_a_service_in_an_outage_is_asked_again_when_it_says(
    submitter: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("api.http.problems.RETRY_SECONDS", 1)
    store, elsewhere = tmp_path / "store", tmp_path / "elsewhere"
    statuses: list[int] = []

    def bring_back(response: httpx2.Response) -> None:
        statuses.append(response.status_code)
        if len(statuses) == 2:
            elsewhere.rename(store)

    submitter._http.event_hooks = {"response": [bring_back]}
    store.rename(elsewhere)
    job = submitter.submit("vesicle-shear")
    assert statuses == [503, 503, 202]
    assert [known.id for known in submitter.jobs()] == [job.id]


def test_a_service_that_asks_for_more_patience_than_a_client_has_refuses(
    submitter: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("api.http.problems.RETRY_SECONDS", 3600)
    statuses: list[int] = []
    submitter._http.event_hooks = {"response": [lambda response: statuses.append(response.status_code)]}
    store = tmp_path / "store"
    store.rename(tmp_path / "elsewhere")
    with pytest.raises(Refused, match="cannot be used at the moment") as refusal:
        submitter.submit("vesicle-shear")
    (tmp_path / "elsewhere").rename(store)
    assert (refusal.value.status, refusal.value.retry_after) == (503, 3600)
    assert statuses == [503]


def test_waiting_goes_on_after_an_outage_of_the_store(
    submitter: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("api.http.problems.RETRY_SECONDS", 1)
    job = submitter.submit("vesicle-shear")
    store, elsewhere = tmp_path / "store", tmp_path / "elsewhere"
    opened: list[int] = []

    def bring_back(response: httpx2.Response) -> None:
        opened.append(response.status_code)
        if response.status_code == 503:
            elsewhere.rename(store)

    submitter._http.event_hooks = {"response": [bring_back]}
    store.rename(elsewhere)
    with Client(str(submitter._http.base_url)) as other:
        finished = submitter.wait(job, lambda _: other.dismiss(job))
    assert opened == [503, 200]
    assert finished.status is JobStatus.DISMISSED


def test_waiting_continues_when_the_service_is_killed_and_restarted(tmp_path: Path) -> None:
    store = tmp_path / "store"
    first = start_service(store, "--workers=0")
    with Client(first.url) as client:
        job = client.submit("doublet-shear", SHORT)
        finished: list[Job] = []
        listening = threading.Event()

        def wait() -> None:
            finished.append(client.wait(job, lambda _: listening.set()))

        waiting = threading.Thread(target=wait)
        waiting.start()
        assert listening.wait(timeout=20)
        first.kill()
        with service(store, port=first.port):
            waiting.join(timeout=60)
    assert [job.status for job in finished] == [JobStatus.SUCCEEDED]
