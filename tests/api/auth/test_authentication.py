"""Who may do what: tokens, their scopes and their expiry."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path

import httpx
import pytest

from api.auth import TokenScope
from api.auth.authentication import is_loopback
from tests.api.servers import client_of, make_token, serving

SUBMISSION = {"preset": "doublet-shear"}
PROTECTED = ["/jobs", "/runs", "/boundaries", "/presets", "/metrics"]
PUBLIC = ["/healthz", "/readyz", "/openapi.json"]


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


def test_guessing_tokens_is_limited(store):
    token = make_token(store, "ada", TokenScope.READ)
    with client_of(store, refusal_rate="5/minute") as client:
        statuses = [client.get("/jobs", headers=bearer(f"guess.{number}")).status_code for number in range(8)]
        assert statuses == [401] * 5 + [429] * 3
        refused = client.get("/jobs", headers=bearer(token))
        assert refused.status_code == 429, "now the valid token is refused as well"
        assert 0 < int(refused.headers["retry-after"]) <= 60


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
        assert httpx.get(f"{address}/jobs", headers=bearer(token)).status_code == 200
        assert ensemble("token", "revoke", identifier, place).returncode == 0
        assert httpx.get(f"{address}/jobs", headers=bearer(token)).status_code == 401
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
