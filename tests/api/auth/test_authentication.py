"""Who may do what: tokens, their scopes and their expiry."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import httpx2
import pytest
from sqlalchemy import update

from api.auth import TokenScope
from api.auth.authentication import is_loopback
from api.auth.tokens import Tokens
from api.database.database_tables import TokenRow
from api.database.service_database import Database
from api.settings import Settings
from tests.api.servers import client_of, make_token, serving

SUBMISSION = {"preset": "doublet-shear"}
PROTECTED = ["/jobs", "/runs", "/boundaries", "/presets", "/metrics"]
PUBLIC = ["/healthz", "/readyz", "/openapi.json"]


def revoke(store: Path, token: str) -> None:
    with Database.open(Settings(store=store).database_url, store) as database:
        Tokens(database).revoke(token.split(".")[0])


def expire(store: Path, token: str) -> None:
    """Let a token expire now."""
    expired = update(TokenRow).where(TokenRow.id == token.split(".")[0]).values(expires=datetime.now(UTC))
    with Database.open(Settings(store=store).database_url, store) as database, database.begin() as connection:
        connection.execute(expired)


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}


def test_without_tokens_everybody_on_this_machine_may_do_everything(submitting):
    assert [submitting.get(path).status_code for path in PROTECTED + PUBLIC] == [200] * 8
    job = submitting.post("/jobs", json=SUBMISSION).json()
    assert submitting.delete(f"/jobs/{job['id']}").status_code == 200


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:80", "localhost.evil.example", "127.0.0.1@evil.example", "[", ""]
)
def test_without_tokens_another_name_for_this_machine_is_refused(submitting, host):
    """A page of another site whose name now resolves to this machine sends that name (DNS rebinding)."""
    response = submitting.post("/jobs", json=SUBMISSION, headers={"Host": host})
    assert response.status_code == 421
    assert submitting.get("/jobs").json()["items"] == []


def test_with_tokens_every_request_needs_one(store):
    token = make_token(store, "ada", TokenScope.READ)
    with client_of(store) as client:
        for path in PROTECTED:
            refused = client.get(path)
            assert refused.status_code == 401
            assert refused.headers["www-authenticate"] == "Bearer"
            assert refused.headers["content-type"] == "application/problem+json"
            assert client.get(path, headers=bearer(token)).status_code == 200
        assert [client.get(path).status_code for path in PUBLIC] == [200] * 3


def test_scopes_include_each_other_in_order(store):
    tokens = {scope: make_token(store, "ada", scope) for scope in TokenScope}
    expected = {TokenScope.READ: (200, 403), TokenScope.SUBMIT: (200, 202), TokenScope.ADMIN: (200, 202)}
    with client_of(store) as client:
        for scope, token in tokens.items():
            read = client.get("/jobs", headers=bearer(token))
            submitted = client.post("/jobs", json=SUBMISSION, headers=bearer(token))
            assert (read.status_code, submitted.status_code) == expected[scope]


def test_jobs_belong_to_the_user_of_the_token(store):
    tokens = [make_token(store, user, TokenScope.SUBMIT) for user in ("ada", "bob", "ada")]
    with client_of(store) as client:
        jobs = [client.post("/jobs", json=SUBMISSION, headers=bearer(token)).json() for token in tokens]
        assert [job["owner"] for job in jobs] == ["ada", "bob", "ada"]
        of_ada = client.get("/jobs", params={"owner": "ada"}, headers=bearer(tokens[1])).json()["items"]
        assert [job["id"] for job in of_ada] == [jobs[2]["id"], jobs[0]["id"]]


def test_the_same_idempotency_key_of_two_users_is_two_jobs(store):
    tokens = [make_token(store, user, TokenScope.SUBMIT) for user in ("ada", "bob")]
    with client_of(store) as client:
        jobs = [
            client.post("/jobs", json=SUBMISSION, headers=bearer(token) | {"Idempotency-Key": "1"}).json()
            for token in tokens
        ]
    assert jobs[0]["id"] != jobs[1]["id"]


def test_a_token_expires(store):
    valid = make_token(store, "ada", TokenScope.READ)
    expired = make_token(store, "ada", TokenScope.READ, timedelta(seconds=-1))
    with client_of(store) as client:
        assert client.get("/jobs", headers=bearer(valid)).status_code == 200
        assert client.get("/jobs", headers=bearer(expired)).status_code == 401


def test_a_service_whose_tokens_have_all_expired_is_not_open(store):
    make_token(store, "ada", TokenScope.READ, timedelta(seconds=-1))
    with client_of(store) as client:
        assert client.get("/jobs").status_code == 401


def near_misses(token: str) -> list[str]:
    """Return the token with each character changed in turn, and parts of the token."""
    other = {at: "1" if character == "0" else "0" for at, character in enumerate(token)}
    identifier, secret = token.split(".")
    changed = [token[:at] + character + token[at + 1 :] for at, character in other.items()]
    return [*changed, token[:-1], token + "x", token.upper(), identifier, f"{identifier}.", secret, "."]


def test_only_the_whole_token_is_accepted(store):
    token = make_token(store, "ada", TokenScope.ADMIN)
    with client_of(store, refusal_rate="100000/second") as client:
        for wrong in near_misses(token):
            assert client.get("/jobs", headers=bearer(wrong)).status_code == 401, wrong
        for header in (f"Basic {token}", token, "Bearer", f"Bearer  {token} {token}"):
            assert client.get("/jobs", headers={"Authorization": header}).status_code == 401
        assert client.get("/jobs", headers={"Cookie": f"token={token}"}).status_code == 401
        assert client.get("/jobs", params={"token": token, "access_token": token}).status_code == 401
        assert client.get("/jobs", headers=bearer(token)).status_code == 200


def guess(client: httpx2.Client, times: int, **headers: str) -> list[int]:
    """Return the statuses of answers to so many invalid tokens."""
    answers = [client.get("/jobs", headers=bearer(f"guess.{number}") | headers) for number in range(times)]
    assert all(0 < int(each.headers["retry-after"]) <= 60 for each in answers if each.status_code == 429)
    return [answer.status_code for answer in answers]


def test_guessing_tokens_is_limited_and_never_stops_a_good_token(store):
    token = make_token(store, "ada", TokenScope.READ)
    with client_of(store, refusal_rate="5/minute") as client:
        assert guess(client, 8) == [401] * 5 + [429] * 3
        assert client.get("/jobs", headers=bearer(token)).status_code == 200


def test_guesses_are_counted_by_the_address_that_a_trusted_proxy_gives(store):
    make_token(store, "ada", TokenScope.READ)
    with client_of(store, refusal_rate="2/minute", trusted_proxies="127.0.0.0/8") as client:
        assert guess(client, 3, **{"X-Forwarded-For": "203.0.113.7"}) == [401, 401, 429]
        assert guess(client, 1, **{"X-Forwarded-For": "203.0.113.8"}) == [401]
        # What the client itself has put before the address that the proxy adds does not count.
        assert guess(client, 1, **{"X-Forwarded-For": "203.0.113.9, 203.0.113.7"}) == [429]


def test_guesses_from_one_network_are_counted_together(store):
    """Whoever has one address of IPv6 has 2⁶⁴ of them."""
    make_token(store, "ada", TokenScope.READ)
    with client_of(store, refusal_rate="2/minute", trusted_proxies="127.0.0.1") as client:
        statuses = [guess(client, 1, **{"X-Forwarded-For": f"2001:db8::{host}"}) for host in range(1, 4)]
        assert statuses == [[401], [401], [429]]
        assert guess(client, 1, **{"X-Forwarded-For": "2001:db8:0:1::1"}) == [401]


def test_what_an_untrusted_client_forwards_does_not_change_its_address(store):
    make_token(store, "ada", TokenScope.READ)
    with client_of(store, refusal_rate="2/minute") as client:
        forwarded = [guess(client, 1, **{"X-Forwarded-For": f"203.0.113.{host}"}) for host in range(3)]
        assert forwarded == [[401], [401], [429]]


def test_requests_that_the_scope_forbids_are_counted_too(store):
    token = make_token(store, "ada", TokenScope.READ)
    with client_of(store, request_rate="3/minute") as client:
        statuses = [
            client.post("/jobs", json=SUBMISSION, headers=bearer(token)).status_code for _ in range(5)
        ]
        assert statuses == [403] * 3 + [429] * 2


def test_the_first_token_closes_a_running_service(store):
    with client_of(store) as client:
        assert client.post("/jobs", json=SUBMISSION).status_code == 202
        token = make_token(store, "ada", TokenScope.READ)
        assert [client.get(path).status_code for path in PROTECTED] == [401] * len(PROTECTED)
        assert client.post("/jobs", json=SUBMISSION).status_code == 401
        assert client.get("/jobs", headers=bearer(token)).status_code == 200
        assert client.post("/jobs", json=SUBMISSION, headers=bearer(token)).status_code == 403


def test_a_service_stays_closed_after_its_last_token_was_revoked(store):
    with serving(store) as address:
        token = make_token(store, "ada", TokenScope.ADMIN)
        revoke(store, token)
        assert httpx2.get(f"{address}/jobs").status_code == 401
        assert httpx2.get(f"{address}/jobs", headers=bearer(token)).status_code == 401
    with client_of(store) as started_again:
        assert started_again.get("/jobs").status_code == 401


@pytest.mark.parametrize(
    "header",
    [
        {"X-Forwarded-For": "203.0.113.7"},
        {"Forwarded": "for=203.0.113.7"},
        {"X-Real-IP": "203.0.113.7"},
        {"X-Forwarded-Host": "vesicles.example"},
        {"Via": "1.1 proxy"},
        {"CF-Connecting-IP": "203.0.113.7"},
    ],
    ids=lambda header: next(iter(header)),
)
@pytest.mark.parametrize("trusted", ["", "127.0.0.1"])
def test_without_tokens_a_request_that_a_proxy_forwards_is_refused(store, header, trusted):
    with client_of(store, trusted_proxies=trusted) as client:
        response = client.post("/jobs", json=SUBMISSION, headers={"Host": "127.0.0.1"} | header)
        assert response.status_code == 421
        assert next(iter(header)).lower() in response.json()["detail"].lower()
        assert client.get("/jobs").json()["items"] == []


OTHER_SITES: list[dict[str, str]] = [
    {"Sec-Fetch-Site": "cross-site"},
    {"Sec-Fetch-Site": "same-site"},
    {"Origin": "https://evil.example"},
    {"Origin": "http://localhost:1"},
    {"Origin": "null"},
]
COSTLY = [*PROTECTED, "/runs?where=outcome=bound", "/kinds", "/flows", f"/runs/{'0' * 32}/frames"]


@pytest.mark.parametrize("headers", OTHER_SITES, ids=str)
def test_pages_of_other_sites_cannot_make_a_service_without_tokens_work(reading, headers):
    assert [reading.get(path, headers=headers).status_code for path in COSTLY] == [403] * len(COSTLY)
    assert reading.post("/estimate", json=SUBMISSION, headers=headers).status_code == 403


def test_the_page_of_the_service_and_addresses_typed_by_users_are_answered(reading):
    own = f"http://{reading.base_url.netloc.decode()}"
    for headers in ({"Sec-Fetch-Site": "same-origin"}, {"Sec-Fetch-Site": "none"}, {"Origin": own}):
        assert reading.get("/runs", headers=headers).status_code == 200, headers


@pytest.mark.parametrize("host", ["127.0.0.2", "127.0.0.2:8000", "[::1]:8000", "LOCALHOST"])
def test_every_loopback_address_is_this_machine(reading, host):
    assert reading.get("/jobs", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize("ended", ["revoked", "expired", "first token"])
def test_an_event_stream_ends_with_its_token(store, ended):
    token = None if ended == "first token" else make_token(store, "ada", TokenScope.SUBMIT)
    with client_of(store, token, event_seconds=0.1) as client:
        job = client.post("/jobs", json=SUBMISSION).json()
        with client.stream("GET", f"/jobs/{job['id']}/events", timeout=60) as events:
            lines = events.iter_lines()
            assert next(lines) == "event: job"
            if token is None:
                make_token(store, "bob", TokenScope.READ)
            else:
                {"revoked": revoke, "expired": expire}[ended](store, token)
            assert "event: job" not in list(lines), "the stream ends, and says nothing more"
        assert client.get(f"/jobs/{job['id']}/events").status_code == 401


def test_the_database_does_not_hold_the_secret(store):
    token = make_token(store, "ada", TokenScope.ADMIN)
    secret = token.split(".")[1]
    for file in store.rglob("*"):
        if file.is_file():
            assert secret.encode() not in file.read_bytes(), file


Run = Callable[..., subprocess.CompletedProcess[str]]


def test_the_command_creates_lists_and_revokes(ensemble: Run, store: Path):
    place = f"--store={store}"
    made = ensemble("token", "create", "ada", "--scope=read", "--days=1", place)
    assert made.returncode == 0, made.stderr
    token = made.stdout.strip()
    identifier = token.split(".")[0]
    listed = ensemble("token", "list", place).stdout
    assert identifier in listed
    assert "ada" in listed
    assert token.split(".")[1] not in listed
    with serving(store) as address:
        assert httpx2.get(f"{address}/jobs", headers=bearer(token)).status_code == 200
        assert ensemble("token", "revoke", identifier, place).returncode == 0
        assert httpx2.get(f"{address}/jobs", headers=bearer(token)).status_code == 401
    assert identifier not in ensemble("token", "list", place).stdout


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["create"], "user"),
        (["create", "ada\r\nX-Injected: 1"], "user"),
        (["create", "ada", "--scope=god"], "scope"),
        (["create", "ada", "--days=-1"], "days"),
        (["revoke", "nothing"], "nothing"),
    ],
)
def test_the_command_refuses_bad_input(ensemble: Run, store: Path, arguments: list[str], named: str):
    result = ensemble("token", *arguments, f"--store={store}")
    assert result.returncode == 2
    assert named in result.stderr
    assert result.stdout == ""


@pytest.mark.parametrize(
    ("host", "expected"),
    [
        ("127.0.0.1", True),
        ("127.9.9.9", True),
        ("::1", True),
        ("localhost", True),
        ("0.0.0.0", False),
        ("::", False),
        ("192.168.1.7", False),
        ("localhost.example", False),
    ],
)
def test_loopback_addresses(host, expected):
    assert is_loopback(host) is expected
