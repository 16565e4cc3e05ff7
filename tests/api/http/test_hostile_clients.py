"""Requests of hostile clients: each is refused with a problem, and the service continues."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Iterator
from contextlib import suppress

import httpx2
import pytest
from sqlalchemy import Engine, event

from api.auth import TokenScope
from api.http.middleware import SECURITY_HEADERS
from ensemble.errors import StoreInputError
from ensemble.store.catalog_tables import RUN_FIELDS, RunRow
from ensemble.store.filters import condition
from tests.api.processes import wait_until
from tests.api.servers import client_of, make_token

JSON = {"Content-Type": "application/json"}
SECONDS = 60  # far less on a machine that has nothing else to do


def post(client: httpx2.Client, content: bytes) -> httpx2.Response:
    return client.post("/jobs", content=content, headers=JSON)


def assert_refused(response: httpx2.Response, *statuses: int) -> None:
    assert response.status_code in statuses, response.text
    assert response.headers["content-type"] == "application/problem+json"
    assert response.json()["status"] == response.status_code


@pytest.fixture(scope="module")
def attacked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx2.Client]:
    with client_of(tmp_path_factory.mktemp("attacked") / "store") as client:
        yield client


@pytest.fixture
def unharmed(attacked: httpx2.Client) -> Iterator[httpx2.Client]:
    """A client of a service that is checked after the test: it has no job and still answers."""
    yield attacked
    assert attacked.get("/jobs").json() == {"items": [], "next": None}


@pytest.mark.parametrize(
    "content",
    [
        b"[" * 100_000,
        b'{"a":' * 40_000,
        b"[" * 500 + b"]" * 500,
        b'{"preset": "doublet-shear", "set": {"flow.rate": ' + b"[" * 400 + b"]" * 400 + b"}}",
        b'{"preset": "doublet-shear", "set": {"' + b"a." * 90 + b'a": 1}}',
        b'{"preset": "doublet-shear", "set": {"' + b"a." * 50_000 + b'a": 1}}',
    ],
)
def test_deeply_nested_documents(unharmed, content):
    assert_refused(post(unharmed, content), 422)


@pytest.mark.parametrize("number", [b"NaN", b"Infinity", b"-Infinity", b"1e999", b"9" * 5000, b'"NaN"'])
@pytest.mark.parametrize("field", [b"horizon", b"flow.rate", b"numerics.tolerance"])
def test_numbers_that_json_does_not_have(unharmed, field, number):
    assert_refused(post(unharmed, b'{"preset": "doublet-shear", "set": {"%s": %s}}' % (field, number)), 422)
    scene = b'{"horizon": %s, "vesicles": [{}]}' % number
    assert_refused(post(unharmed, b'{"scene": %s}' % scene), 422)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"\xff\xfe",
        b'{"preset": "\\ud800"}',
        b'{"preset": "a\\u0000b"}',
        b'{"\\ud800": 1}',
        b'{"preset": "doublet-shear", "set": {"\\ud800": 1}}',
        b'{"preset": "doublet-shear", "set": {"flow.kind": "\\u0000"}}',
        b'{"preset": "doublet-shear", "set": {"": 1}}',
        b'{"preset": "doublet-shear", "set": {"...": 1}}',
        b'{"preset": "doublet-shear", "set": {"__class__": 1}}',
        b"null",
        b"true",
        b'"doublet-shear"',
    ],
)
def test_bodies_that_are_not_json_documents(unharmed, content):
    assert_refused(post(unharmed, content), 422)


@pytest.mark.parametrize(
    "submission",
    [
        {"preset": "doublet-shear", "set": {"numerics.points": 2**40}},
        {"preset": "doublet-shear", "set": {"numerics.points": 1024, "horizon": 1e9}},
        {"preset": "doublet-shear", "set": {"output.interval": 1e-300, "horizon": 1e300}},
        {"scene": {"horizon": 1.0, "vesicles": [{}] * 20_000}},
        {"preset": "doublet-shear", "set": {"vesicles": [{}] * 20_000}},
        {"preset": "critical-hamaker", "set": {"scene": {"horizon": 1.0, "vesicles": [{}] * 20_000}}},
        {"preset": "critical-hamaker", "set": {"sweep.values": list(range(1, 20_000))}},
        {"preset": "critical-hamaker", "set": {"search.tolerance": 1e-300}},
        {"preset": "suspension-shear", "set": {"arrangement.count": 4000, "vesicles.angle": 1.0}},
        {"preset": "suspension-shear", "set": {"arrangement.count": "4000"}},
        {"preset": "suspension-shear", "set": {"arrangement.count": 4000.0}},
        {"scene": {"horizon": 1, "arrangement": {"kind": "lattice", "columns": 64, "rows": 64}}},
        {"preset": "doublet-shear", "set": {"output.interval": 1e-300}},
        {"preset": "doublet-shear", "set": {"output.frame_interval": 1e-5}},
        {"preset": "critical-hamaker", "set": {"sweep.parameter": "output.interval", "sweep.values": [1e-9]}},
        {"preset": "critical-hamaker", "set": {"search.limits": [5e-324, 1.7e308], "scene.horizon": 1e9}},
        {"preset": "doublet-shear", "set": {f"criteria.{number}": 1 for number in range(10_000)}},
        {"preset": "doublet-shear", "set": {"vesicles": [[[]]] * 40_000}},
        {"preset": "doublet-shear", "set": {"output.frame_interval": 2e-4, "horizon": 1e4}},
    ],
)
def test_excessive_work_is_refused_at_once(unharmed, submission):
    begun = time.monotonic()
    assert_refused(unharmed.post("/jobs", json=submission), 422)
    assert time.monotonic() - begun < SECONDS


@pytest.mark.parametrize("announced", [True, False])
def test_a_body_that_is_too_large(store, announced):
    with client_of(store, body_bytes=10_000) as client:
        body = json.dumps({"preset": "doublet-shear", "set": {"flow.kind": "x" * 20_000}}).encode()
        pieces = (body[at : at + 1000] for at in range(0, len(body), 1000))
        response = client.post("/jobs", content=body if announced else pieces, headers=JSON)
        assert_refused(response, 413)
        assert "10000" in response.json()["detail"]
        assert client.get("/jobs").json()["items"] == []
        assert client.post("/jobs", json={"preset": "doublet-shear"}).status_code == 202


TRAVERSALS = [
    "../../etc/passwd",
    "..%2f..%2fetc%2fpasswd",
    "%2e%2e/%2e%2e/etc/passwd",
    "....//catalog.sqlite",
    "%00",
    "a%0d%0aX-Injected:%201",
    "..\\..\\catalog.sqlite",
    "%252e%252e%252fcatalog.sqlite",
    "catalog.sqlite",
    "0" * 5000,
]


@pytest.mark.parametrize("name", TRAVERSALS)
@pytest.mark.parametrize(
    "address",
    [
        "/runs/{}",
        "/runs/{}/frames",
        "/boundaries/{}",
        "/jobs/{}",
        "/jobs/{}/log",
        "/jobs/{}/events",
        "/assets/{}",
    ],
)
def test_paths_do_not_leave_their_folder(reading, address, name):
    base = reading.base_url
    request = reading.build_request("GET", "/")
    # Sent unchanged: the client would normalize it.
    request.url = base.copy_with(raw_path=address.format(name).encode())
    response = reading.send(request)
    assert_refused(response, 404, 422)
    assert "x-injected" not in response.headers
    assert b"root:" not in response.content
    assert b"SQLite" not in response.content


@pytest.mark.parametrize(
    "condition",
    [
        "outcome=bound' OR '1'='1",
        "outcome=bound; DROP TABLE runs",
        "name='; DELETE FROM runs; --",
        "flow.rate>=0 OR 1=1",
        "flow.rate) OR (1=1",
        "key=' UNION SELECT digest FROM tokens --",
        "failure=' OR failure IS NULL --",
        "$.flow.rate=1",
        'scene"]=1',
    ],
)
def test_filters_are_not_interpreted_as_sql(reading, condition):
    before = reading.get("/runs").json()
    response = reading.get("/runs", params={"where": condition})
    if response.status_code == 200:
        assert response.json()["items"] == []
    else:
        assert_refused(response, 422)
    assert reading.get("/runs").json() == before


@pytest.mark.parametrize("number", ["NaN", "-Infinity", "1e999"])
def test_filters_compare_with_finite_numbers(reading, number):
    assert_refused(reading.get("/runs", params={"where": f"flow.rate>{number}"}), 422)


def raw(client: httpx2.Client, *pieces: bytes, pause: float = 0.0) -> bytes:
    """Send bytes unchanged, and return everything that is answered until the connection ends."""
    address = (client.base_url.host, client.base_url.port)
    with socket.create_connection(address, timeout=SECONDS) as connection:
        try:
            for piece in pieces:
                connection.sendall(piece)
                time.sleep(pause)
        except (BrokenPipeError, ConnectionResetError):
            pass  # the service has closed the connection
        answer = b""
        try:
            while received := connection.recv(65536):
                answer += received
        except ConnectionResetError:
            pass
        return answer


def status_of(answer: bytes) -> int:
    return int(answer.split(b" ", 2)[1])


HEAD = b"Host: localhost\r\nConnection: close\r\n"


@pytest.mark.parametrize("target", [b"/jobs?a=" + b"x" * 100_000, b"/jobs\x00"])
def test_what_is_no_request_is_refused_as_a_problem(submitting, target):
    head, _, body = raw(submitting, b"GET " + target + b" HTTP/1.1\r\n" + HEAD + b"\r\n").partition(
        b"\r\n\r\n"
    )
    assert head.startswith(b"HTTP/1.1 400 ")
    assert b"application/problem+json" in head
    assert b"nosniff" in head
    assert json.loads(body)["status"] == 400


def test_a_client_that_goes_away_in_its_body_is_no_error_of_the_server(submitting):
    head = b"Content-Type: application/json\r\nContent-Length: 9\r\n\r\n{"
    with socket.create_connection((submitting.base_url.host, submitting.base_url.port)) as connection:
        connection.sendall(b"POST /jobs HTTP/1.1\r\n" + HEAD + head)
        connection.shutdown(socket.SHUT_WR)
        with suppress(ConnectionResetError):
            connection.recv(1000)
    counted = 'ensemble_requests_total{method="POST",route="/jobs",status="%d"} 1.0'
    wait_until(lambda: counted % 400 in submitting.get("/metrics").text.splitlines())
    assert counted % 500 not in submitting.get("/metrics").text


@pytest.mark.parametrize(
    "head",
    [
        b"GET /jobs HTTP/1.1\r\n" + HEAD + b"Idempotency-Key: a\r\n b\r\n\r\n",
        b"GET /jobs HTTP/1.1\r\n" + HEAD + b"X: a\x00b\r\n\r\n",
        b"GET /jobs X-Injected: 1 HTTP/1.1\r\n" + HEAD + b"\r\n",
        b"POST /jobs HTTP/1.1\r\n" + HEAD + b"Content-Length: 5\r\nContent-Length: 6\r\n\r\n{}",
        b"POST /jobs HTTP/1.1\r\n" + HEAD + b"Content-Length: -1\r\n\r\n{}",
        b"POST /jobs HTTP/1.1\r\n"
        + HEAD
        + b"Content-Length: 5\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
        b"NONSENSE\r\n\r\n",
    ],
)
def test_invalid_heads(unharmed, head):
    assert 400 <= status_of(raw(unharmed, head)) < 500


def test_headers_of_answers_hold_nothing_that_a_client_sent(store):
    token = make_token(store, "ada", TokenScope.SUBMIT)
    with client_of(store, token) as client:
        _send_injections(client)


def _send_injections(submitting: httpx2.Client) -> None:
    made = submitting.post(
        "/jobs",
        json={"preset": "doublet-shear"},
        headers={"Idempotency-Key": "a%0d%0aX-Injected: 1", "X-Forwarded-Host": "evil.example"},
    )
    assert made.status_code == 202
    assert made.headers["location"] == f"jobs/{made.json()['id']}"
    assert "injected" not in str(made.headers)
    listed = submitting.get(
        "/jobs", params={"limit": 1, "x": "\r\nX-Injected: 1"}, headers={"Host": "localhost"}
    )
    assert "injected" not in str(listed.headers).lower()


@pytest.mark.parametrize(
    "condition",
    [
        "a=b" + " " * 900 + "\n",
        "a=b" + " " * 31_000 + "\n",
        " " * 31_000 + "=",
        "a." * 10_000 + "=1",
        "=" * 10_000,
        "flow.rate=" + "9" * 30_000,
        "flow.rate" + "\t" * 10_000 + "x",
    ],
)
@pytest.mark.parametrize("kind", ["runs", "boundaries"])
def test_long_filters_are_refused(reading, kind, condition):
    answer = reading.get(f"/{kind}", params={"where": condition})
    assert_refused(answer, 422, 400)
    assert len(answer.content) < 5000


@pytest.mark.parametrize(
    "text", ["a=b" + " " * 1_000_000 + "\n", "a=" + "b " * 500_000 + "\n", " " * 1_000_000]
)
def test_filters_are_parsed_in_linear_time(text):
    begun = time.process_time()
    with pytest.raises(StoreInputError):
        condition(text, RunRow.document, RUN_FIELDS)
    assert time.process_time() - begun < 2.0


@pytest.mark.parametrize(
    "submission",
    [{"preset": "x" * 200_000}, {"preset": "doublet-shear", "set": {"flow.kind": "x" * 200_000}}],
)
def test_what_is_refused_is_not_sent_back_whole(unharmed, submission):
    answer = unharmed.post("/jobs", json=submission)
    assert_refused(answer, 422)
    assert len(answer.content) < 20_000


def test_submitting_and_dismissing_is_limited(store):
    with client_of(store, submission_rate="5/minute", maximum_jobs=2) as client:
        statuses = []
        for _ in range(7):
            made = client.post("/jobs", json={"preset": "doublet-shear"})
            statuses.append(made.status_code)
            if made.status_code == 202:
                client.delete(f"/jobs/{made.json()['id']}")
        assert statuses == [202] * 5 + [429] * 2
        assert int(made.headers["retry-after"]) > 0


def test_whether_a_service_is_ready_does_not_depend_on_how_many_jobs_it_has(store):
    """No statement of its check goes through all jobs."""
    with client_of(store) as client:
        client.get("/readyz")
        statements: list[str] = []
        event.listen(Engine, "before_cursor_execute", lambda *arguments: statements.append(arguments[2]))
        assert client.get("/readyz").status_code == 200
        assert statements
        assert [statement for statement in statements if "count(" in statement] == []
        counted = len(statements)
        assert {client.get("/metrics").status_code for _ in range(20)} == {200}
        counts = [statement for statement in statements[counted:] if "count(" in statement]
        assert 0 < len(counts) < 10, "the numbers of jobs are kept for some seconds"


def test_a_head_that_does_not_arrive_in_time(store):
    with client_of(store, header_seconds=0.5) as client:
        begun = time.monotonic()
        assert status_of(raw(client, b"GET /jobs HTTP/1.1\r\nHost: localhost\r\n")) == 400
        assert status_of(raw(client, *[b"GET /jobs HTTP/1.1\r\n", *[b"X: y\r\n"] * 20], pause=0.1)) == 400
        assert time.monotonic() - begun < SECONDS
        assert client.get("/jobs").status_code == 200


def test_an_endless_head(store):
    with client_of(store, header_bytes=10_000) as client:
        endless = [b"GET /jobs HTTP/1.1\r\nHost: localhost\r\n", *[b"X: " + b"y" * 1000 + b"\r\n"] * 100]
        assert status_of(raw(client, *endless)) == 400
        assert status_of(raw(client, b"GET /" + b"y" * 100_000)) == 400
        at_once = b"GET /jobs HTTP/1.1\r\n" + HEAD + b"X: " + b"y" * 20_000 + b"\r\n\r\n"
        assert status_of(raw(client, at_once)) == 400
        assert client.get("/jobs").status_code == 200


def test_a_body_that_does_not_arrive_in_time(store):
    with client_of(store, body_seconds=0.5) as client:
        head = (
            b"POST /jobs HTTP/1.1\r\n"
            + HEAD
            + b"Content-Type: application/json\r\nContent-Length: 100\r\n\r\n"
        )
        answer = raw(client, head, b'{"preset":')
        assert status_of(answer) == 408
        assert b"application/problem+json" in answer
        dripping = raw(client, head, *[b" "] * 20, pause=0.1)
        assert status_of(dripping) == 408
        assert client.get("/jobs").json()["items"] == []


def test_many_idle_connections_do_not_block_others(store):
    with client_of(store, header_seconds=1.0, connections=50) as client:
        address = (client.base_url.host, client.base_url.port)
        idle = [socket.create_connection(address, timeout=SECONDS) for _ in range(80)]
        try:
            deadline = time.monotonic() + SECONDS
            while client.get("/healthz").status_code != 200:
                assert time.monotonic() < deadline
                time.sleep(0.1)
        finally:
            for connection in idle:
                connection.close()


def test_requests_are_counted_for_each_user(store):
    ada, bob = (make_token(store, user, TokenScope.READ) for user in ("ada", "bob"))
    with client_of(store, request_rate="5/minute") as client:

        def ask(token: str) -> httpx2.Response:
            return client.get("/jobs", headers={"Authorization": f"Bearer {token}"})

        assert [ask(ada).status_code for _ in range(7)] == [200] * 5 + [429] * 2
        refused = ask(ada)
        assert_refused(refused, 429)
        assert 0 < int(refused.headers["retry-after"]) <= 60
        assert ask(bob).status_code == 200


@pytest.mark.parametrize("path", ["/jobs", "/nowhere", "/healthz", "/jobs/UPPER"])
def test_every_answer_has_the_security_headers_and_other_sites_may_not_read_it(reading, path):
    response = reading.get(path, headers={"Origin": "https://evil.example"})
    for name, value in SECURITY_HEADERS.items():
        assert response.headers[name] == value
    assert not [name for name in response.headers if name.startswith("access-control")]
    assert "server" not in response.headers


@pytest.mark.parametrize("method", ["POST", "DELETE", "OPTIONS", "TRACE"])
@pytest.mark.parametrize("path", ["/", "/openapi.json", "/healthz", "/assets/main.js"])
def test_other_methods_are_refused_with_those_that_are_allowed(reading, method, path):
    answer = reading.request(method, path)
    assert_refused(answer, 405)
    assert "GET" in answer.headers["allow"]


def test_preflight_requests_of_other_sites_are_refused(reading):
    response = reading.options(
        "/jobs",
        headers={
            "Origin": "https://evil.example",
            "Access-Control-Request-Method": "POST",
            "Access-Control-Request-Headers": "content-type",
        },
    )
    assert response.status_code == 405
    assert response.headers["allow"] == "GET, POST"
    assert not [name for name in response.headers if name.startswith("access-control")]
