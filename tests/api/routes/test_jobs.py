"""Jobs over HTTP: submitted, listed, watched, dismissed."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx2
import pytest

from api.auth import TokenScope
from api.database.service_database import Database
from api.jobs.job import JobStatus
from api.jobs.job_queue import Jobs
from api.settings import Settings
from ensemble.config.documents import load_scene, load_study, preset_names
from tests.api.processes import wait_until
from tests.api.servers import client_of, make_token, serving

UNITS = {"radius": "10 um", "bending_modulus": "1e-19 J", "viscosity": "1 mPa*s"}
SECONDS = 600  # until an answer is given up


@pytest.fixture
def queue(store: Path) -> Iterator[Jobs]:
    """The queue of the service to which `submitting` submits."""
    with Database.open(Settings(store=store).database_url, store) as database:
        yield Jobs(database, store)


def submit(client: httpx2.Client, headers: dict[str, str] | None = None, **submission: Any) -> dict[str, Any]:
    response = client.post("/jobs", json=submission, headers=headers)
    assert response.status_code == 202, response.text
    return response.json()


def test_a_preset_becomes_a_job(submitting, queue):
    response = submitting.post("/jobs", json={"preset": "critical-hamaker", "ranks": 1, "seconds": 60})
    assert response.status_code == 202
    job = response.json()
    assert (job["kind"], job["name"], job["status"]) == ("study", "critical-hamaker", "accepted")
    assert (job["ranks"], job["seconds"], job["progress"], job["attempts"]) == (1, 60, 0, 0)
    assert job["key"] == load_study("critical-hamaker").key
    assert response.url.join(response.headers["location"]).path == f"/jobs/{job['id']}"
    assert submitting.get(response.headers["location"]).json() == job
    assert queue.get(job["id"]).owner == "local"


def test_the_job_has_the_changes(submitting, queue):
    job = submit(submitting, preset="doublet-shear", set={"flow.rate": 0.75, "vesicles.reduced_area": 0.8})
    scene = queue.document(queue.get(job["id"]))
    assert scene["flow"] == {"kind": "shear", "rate": 0.75}
    assert [vesicle["reduced_area"] for vesicle in scene["vesicles"]] == [0.8, 0.8]


@pytest.mark.parametrize("kind", ["study", "scene"])
def test_a_document_makes_the_same_job_as_its_preset(submitting, kind):
    preset, model = {
        "study": ("critical-hamaker", load_study("critical-hamaker")),
        "scene": ("doublet-shear", load_scene("doublet-shear")),
    }[kind]
    given = submit(submitting, **{kind: model.model_dump(mode="json")})
    named = submit(submitting, preset=preset)
    assert given["kind"] == kind
    assert given["key"] == named["key"]
    assert given["id"] != named["id"]


def test_a_scene_with_units_makes_the_same_job(submitting, queue):
    scene = load_scene("doublet-shear").model_dump(mode="json")
    measured = scene | {"units": UNITS, "flow": {"kind": "shear", "rate": "0.05 1/s"}}
    given = submit(submitting, scene=measured)
    changed = submit(submitting, preset="doublet-shear", set={"units": UNITS, "flow.rate": "3 1/min"})
    assert given["key"] == changed["key"] == submit(submitting, preset="doublet-shear")["key"]
    document = queue.document(queue.get(given["id"]))
    assert (document["units"], document["flow"]["rate"]) == (UNITS, 0.5)


def with_low(outcome: str | None) -> dict[str, Any]:
    """A study with something else for an outcome."""
    study = load_study("critical-hamaker").model_dump(mode="json")
    return study | {"search": study["search"] | {"low": [outcome]}}


@pytest.mark.parametrize(
    ("submission", "named"),
    [
        ({}, "one of preset, study"),
        ({"preset": "doublet-shear", "scene": {"horizon": 1.0, "vesicles": [{}]}}, "preset and scene"),
        ({"preset": "../../etc/passwd"}, "not a preset"),
        ({"preset": "critical-hamaker", "nonsense": 1}, "nonsense"),
        ({"preset": "critical-hamaker", "set": {"nonsense": 1}}, "nonsense"),
        ({"preset": "critical-hamaker", "set": {"scene.numerics.points": 7}}, "scene.numerics.points"),
        ({"preset": "doublet-shear", "set": {"vesicles.7.angle": 1}}, "vesicles.7"),
        ({"preset": "doublet-shear", "set": {"flow.rate": [1]}}, "flow.rate"),
        ({"scene": {"horizon": "100", "vesicles": [{}]}}, "scene.horizon"),
        ({"scene": {"units": UNITS, "horizon": "3 m", "vesicles": [{}]}}, "such as '0.5 s'"),
        ({"scene": {"horizon": "3 s", "vesicles": [{}]}}, "scene.horizon: '3 s' — a unit needs those of"),
        ({"scene": {"horizon": 100, "vesicles": [{}, {}]}}, "vesicles 0 and 1 overlap"),
        ({"preset": "doublet-shear", "ranks": 0}, "ranks"),
        ({"preset": "doublet-shear", "ranks": 1.5}, "ranks"),
        ({"preset": "doublet-shear", "seconds": 0}, "seconds"),
        ({"study": with_low("x")}, "study.search.low.0: 'x' — input should be 'bound', "),
        ({"study": with_low(None)}, "study.search.low.0: None — input should be 'bound', "),
        ([], "object"),
    ],
)
def test_bad_submissions_are_refused_and_named(submitting, submission, named):
    for route in ("/jobs", "/estimate"):
        response = submitting.post(route, json=submission)
        assert response.status_code == 422
        assert response.headers["content-type"] == "application/problem+json"
        assert named in response.json()["detail"]
    assert submitting.get("/jobs").json() == {"items": [], "next": None}


@pytest.mark.parametrize("preset", ["critical-hamaker", "doublet-shear"])
def test_a_job_can_be_submitted_again_as_it_was(submitting, preset):
    job = submit(
        submitting, preset=preset, set={"criteria.revolutions": 3} if preset == "doublet-shear" else {}
    )
    again = submit(submitting, **submitting.get(f"/jobs/{job['id']}/submission").json())
    assert again["id"] != job["id"]
    for same in ("kind", "key", "ranks", "seconds"):
        assert again[same] == job[same]
    assert submitting.get(f"/jobs/{32 * '0'}/submission").status_code == 404


def test_other_content_than_json_is_refused(submitting):
    response = submitting.post(
        "/jobs", content=b"preset=doublet-shear", headers={"Content-Type": "text/plain"}
    )
    assert response.status_code == 415
    assert "application/json" in response.json()["detail"]


def test_concurrent_requests_with_one_idempotency_key_make_one_job(submitting):
    body = {"preset": "doublet-shear"}
    headers = {"Idempotency-Key": "the same"}
    ready = threading.Barrier(50)

    def once(_: int) -> str:
        ready.wait()
        return str(submit(submitting, headers, **body)["id"])

    with ThreadPoolExecutor(50) as pool:
        assert len(set(pool.map(once, range(50)))) == 1
    assert len(submitting.get("/jobs").json()["items"]) == 1
    other = submitting.post("/jobs", json={"preset": "vesicle-shear"}, headers=headers)
    assert other.status_code == 422
    assert submit(submitting, {"Idempotency-Key": "another"}, **body)["id"]
    assert len(submitting.get("/jobs").json()["items"]) == 2


@pytest.mark.parametrize("limit", [1, 2, 3, 7, 100])
def test_jobs_are_paged_latest_first(submitting, limit):
    made = [submit(submitting, preset="doublet-shear")["id"] for _ in range(7)]
    listed, address = [], f"/jobs?limit={limit}"
    while address:
        page = submitting.get(address).json()
        listed += [job["id"] for job in page["items"]]
        address = page["next"]
    assert listed == made[::-1]


def test_jobs_are_found_by_status_and_owner(submitting):
    jobs = [submit(submitting, preset="doublet-shear") for _ in range(3)]
    assert submitting.delete(f"/jobs/{jobs[1]['id']}").json()["status"] == "dismissed"

    def listed(**query: str) -> list[str]:
        return [job["id"] for job in submitting.get("/jobs", params=query).json()["items"]]

    assert listed(status="dismissed") == [jobs[1]["id"]]
    assert listed(status="accepted") == [jobs[2]["id"], jobs[0]["id"]]
    assert listed(owner="nobody") == []
    assert submitting.get("/jobs", params={"status": "lost"}).status_code == 422
    assert submitting.get("/jobs", params={"after": "0" * 32}).status_code == 422


def test_an_unknown_job_is_not_found(submitting):
    for part in ("", "/events", "/log"):
        assert submitting.get(f"/jobs/{'0' * 32}{part}").status_code == 404
    assert submitting.delete(f"/jobs/{'0' * 32}").status_code == 404


def events(response: httpx2.Response) -> Iterator[tuple[str, dict[str, Any]]]:
    name = ""
    for line in response.iter_lines():
        field, _, value = line.partition(": ")
        if field == "event":
            name = value
        elif field == "data":
            yield name, json.loads(value)


def test_events_are_sent_for_every_change_until_the_end(submitting, queue):
    job = submit(submitting, preset="doublet-shear")
    with submitting.stream("GET", f"/jobs/{job['id']}/events", timeout=SECONDS) as response:
        assert response.headers["content-type"].startswith("text/event-stream")
        received = events(response)
        assert next(received) == ("job", job)
        lease = queue.lease("worker")
        assert lease is not None
        running = next(received)[1]
        assert (running["status"], running["attempts"]) == ("running", 1)
        assert queue.heartbeat(lease, 40, "four of ten")
        middle = next(received)[1]
        assert (middle["progress"], middle["message"]) == (40, "four of ten")
        assert queue.finish(lease, JobStatus.SUCCEEDED, "done")
        last = next(received)[1]
        assert (last["status"], last["message"]) == ("succeeded", "done")
        assert list(received) == []
    assert submitting.get(f"/jobs/{job['id']}").json() == last


def test_the_log_is_served_while_it_grows(submitting, queue):
    job = submit(submitting, preset="doublet-shear")
    address = f"/jobs/{job['id']}/log"
    assert submitting.get(address).text == ""
    path = queue.log_path(queue.get(job["id"]))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("flow.rate 0.5: 0.36 – 0.37 converged\n", encoding="utf-8")
    assert submitting.get(address).text == "flow.rate 0.5: 0.36 – 0.37 converged\n"
    with path.open("a", encoding="utf-8") as log:
        log.writelines(f"line {number}\n" for number in range(200_000))
    long = submitting.get(address)
    assert long.headers["content-type"] == "text/plain; charset=utf-8"
    assert len(long.content) == 1 << 20
    assert long.text.endswith("line 199999\n")


def test_only_its_owner_or_an_admin_dismisses_a_job(store):
    tokens = {user: make_token(store, user, scope) for user, scope in OWNERS.items()}
    with serving(store) as address:

        def asking(user: str) -> httpx2.Client:
            return httpx2.Client(base_url=address, headers={"Authorization": f"Bearer {tokens[user]}"})

        with asking("ada") as ada, asking("bob") as bob, asking("eve") as eve, asking("root") as root:
            job = submit(ada, preset="doublet-shear")
            assert job["owner"] == "ada"
            assert bob.get(f"/jobs/{job['id']}").json() == job
            for other in (bob, eve):
                refused = other.delete(f"/jobs/{job['id']}")
                assert refused.status_code == 403
            assert eve.post("/jobs", json={"preset": "doublet-shear"}).status_code == 403
            assert eve.post("/estimate", json={"preset": "doublet-shear"}).status_code == 200
            assert ada.get(f"/jobs/{job['id']}").json()["status"] == "accepted"
            assert root.delete(f"/jobs/{job['id']}").json()["status"] == "dismissed"
            mine = submit(bob, preset="doublet-shear")
            assert bob.delete(f"/jobs/{mine['id']}").json()["status"] == "dismissed"


OWNERS = {
    "ada": TokenScope.SUBMIT,
    "bob": TokenScope.SUBMIT,
    "eve": TokenScope.READ,
    "root": TokenScope.ADMIN,
}


def test_presets_are_given_in_full_and_with_their_cost(submitting):
    presets = submitting.get("/presets").json()["items"]
    assert [preset["name"] for preset in presets] == list(preset_names())
    for preset in presets:
        again = submitting.post("/estimate", json={preset["kind"]: preset["document"]})
        assert again.json() == preset["estimate"]
        assert preset["estimate"]["accepted"]


def test_memory_grows_with_the_square_of_all_points_if_there_is_a_contrast(submitting):
    def memory(points: int, contrast: float) -> float:
        changes = {"numerics.points": points, "vesicles.viscosity_contrast": contrast}
        submission = {"preset": "suspension-shear", "set": changes}
        return submitting.post("/estimate", json=submission).json()["memory"]

    assert memory(512, 4.0) - memory(256, 4.0) == pytest.approx(
        4 * (memory(256, 4.0) - memory(128, 4.0)), 0.01
    )
    assert memory(512, 1.0) < 1.3 * memory(128, 1.0)


def test_a_job_that_needs_too_much_memory_is_refused(store):
    fine = {"numerics.points": 128, "vesicles.viscosity_contrast": 4.0}
    large = {"preset": "suspension-shear", "set": fine}
    with client_of(store, maximum_memory=2_000_000_000) as client:
        assert not client.post("/estimate", json=large).json()["accepted"]
        refused = client.post("/jobs", json=large)
        assert refused.status_code == 422
        assert "memory: 3.26e+09" in refused.json()["detail"]
        assert refused.json()["memory"] > refused.json()["most_memory"] == 2e9
        small = {"preset": "critical-hamaker"}
        assert client.post("/jobs", json={**small, "ranks": 2}).status_code == 202
    with client_of(store, maximum_memory=800_000_000, maximum_ranks=2) as client:
        refused = client.post("/jobs", json={**small, "ranks": 2})
        assert refused.status_code == 422
        assert "ranks: 2 — must be at most 1" in refused.json()["detail"]
        assert client.post("/jobs", json=small).json()["ranks"] == 1


def test_the_estimate_is_points_times_vesicles_times_time(submitting):
    scene = load_scene("doublet-shear").model_dump(mode="json")
    estimate = submitting.post("/estimate", json={"scene": scene}).json()
    assert estimate["runs"] == 1
    assert estimate["cost"] == 64 * 2 * 400.0
    many = {"preset": "suspension-shear", "set": {"arrangement.count": 40}}
    assert submitting.post("/estimate", json=many).json()["cost"] == 64 * 40 * 20.0
    finer = submitting.post("/estimate", json={"scene": scene, "set": {"numerics.points": 128}}).json()
    assert finer["cost"] == 2 * estimate["cost"]
    study = submitting.post("/estimate", json={"preset": "critical-hamaker"}).json()
    certified = submitting.post(
        "/estimate", json={"preset": "critical-hamaker", "set": {"search.certify": True}}
    ).json()
    # Two runs at each point have half as many points more: they confirm, or certify.
    assert certified["runs"] == study["runs"]
    assert study["cost"] == (study["runs"] + 2 * 6 * 0.5) * 64 * 2 * 6400.0
    assert certified["cost"] == study["cost"]


def test_a_job_that_costs_too_much_is_refused_with_the_number(store):
    cost = 64 * 2 * 400.0
    with client_of(store, maximum_cost=cost) as client:
        submit(client, preset="doublet-shear")
        changes = {"horizon": 401.0}
        estimate = client.post("/estimate", json={"preset": "doublet-shear", "set": changes}).json()
        assert not estimate["accepted"]
        refused = client.post("/jobs", json={"preset": "doublet-shear", "set": changes})
        assert refused.status_code == 422
        assert (refused.json()["cost"], refused.json()["maximum"]) == (estimate["cost"], cost)
        endless = client.post("/jobs", json={"preset": "doublet-shear", "set": {"horizon": 1e308}})
        assert endless.status_code == 422


def test_ranks_seconds_and_jobs_are_bounded(store):
    with client_of(store, maximum_ranks=2, maximum_seconds=60, maximum_jobs=3) as client:
        for field, value in (("ranks", 3), ("seconds", 61)):
            refused = client.post("/jobs", json={"preset": "doublet-shear", field: value})
            assert refused.status_code == 422
            assert f"{field}: {value} — must be at most" in refused.json()["detail"]
        study = submit(client, preset="critical-hamaker")
        assert (study["ranks"], study["seconds"]) == (2, 60)
        assert submit(client, preset="doublet-shear")["ranks"] == 1
        submit(client, preset="doublet-shear", ranks=2, seconds=60)
        refused = client.post("/jobs", json={"preset": "doublet-shear"})
        assert refused.status_code == 429
        client.delete(f"/jobs/{study['id']}")
        submit(client, preset="doublet-shear")


def test_metrics_count_jobs_and_requests(submitting):
    submit(submitting, preset="doublet-shear")
    submitting.get("/jobs/" + "0" * 32)
    submitting.get("/made/up")
    metrics = submitting.get("/metrics").text.splitlines()
    assert 'ensemble_jobs{status="accepted"} 1.0' in metrics
    assert 'ensemble_requests_total{method="POST",route="/jobs",status="202"} 1.0' in metrics
    assert 'ensemble_requests_total{method="GET",route="/jobs/{identifier}",status="404"} 1.0' in metrics
    assert 'ensemble_requests_total{method="GET",route="unknown",status="404"} 1.0' in metrics


def test_health(submitting):
    assert submitting.get("/healthz").json() == {"status": "alive"}
    assert submitting.get("/readyz").json() == {"status": "ready"}


def test_a_service_whose_store_is_gone_is_alive_but_not_ready(store):
    with client_of(store) as client:
        (store / "catalog.sqlite").write_bytes(b"no database" * 1000)
        assert client.get("/healthz").status_code == 200
        response = client.get("/readyz")
        assert response.status_code == 503
        assert response.headers["content-type"] == "application/problem+json"


def test_the_streams_of_each_user_are_limited(store):
    headers = {
        user: {"Authorization": f"Bearer {make_token(store, user, TokenScope.SUBMIT)}"}
        for user in ("ada", "bob")
    }
    with serving(store, event_streams=2, event_seconds=0.1) as address, ExitStack() as opened:

        def opens(user: str) -> httpx2.Response:
            asked = httpx2.stream("GET", f"{address}/jobs/{job}/events", headers=headers[user])
            return opened.enter_context(asked)

        work = {"preset": "doublet-shear"}
        job = httpx2.post(f"{address}/jobs", json=work, headers=headers["ada"]).json()["id"]
        first, second, third = (opens("ada") for _ in range(3))
        assert (first.status_code, second.status_code, third.status_code) == (200, 200, 429)
        assert "2 streams open" in json.loads(third.read())["detail"]
        assert opens("bob").status_code == 200, "each user has a limit of his own"
        missing = httpx2.get(f"{address}/jobs/{'0' * 32}/events", headers=headers["bob"])
        assert missing.status_code == 404
        first.close()
        wait_until(lambda: opens("ada").status_code == 200)
        # What ends by itself makes room, too.
        httpx2.delete(f"{address}/jobs/{job}", headers=headers["ada"])
        assert "dismissed" in second.read().decode()
        wait_until(lambda: [opens("ada").status_code for _ in range(3)] == [200] * 3)


def test_a_hundred_listeners_get_the_last_event(submitting, queue):
    job = submit(submitting, preset="doublet-shear")
    address = f"{submitting.base_url}/jobs/{job['id']}/events"
    listening = threading.Semaphore(0)

    def listen(_: int) -> str:
        with httpx2.stream("GET", address, timeout=SECONDS) as response:
            received = events(response)
            next(received)
            listening.release()
            return str(list(received)[-1][1]["status"])

    with ThreadPoolExecutor(100) as pool:
        results = [pool.submit(listen, number) for number in range(100)]
        deadline = time.monotonic() + SECONDS
        for _ in range(100):
            assert listening.acquire(timeout=deadline - time.monotonic())
        submitting.delete(f"/jobs/{job['id']}")
        assert {result.result() for result in results} == {"dismissed"}
