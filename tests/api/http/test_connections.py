"""Every phase of a connection has its time and its size, on real sockets with small limits."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from urllib.parse import urlsplit

import httpx2
import pytest

from api.auth import TokenScope
from api.routes.web_page import ASSETS, assets_digest
from tests.api.servers import make_token, serving

SECONDS = 60  # until a connection is given up as never closed; far more than the limits below
LIMITS = {
    "header_seconds": 0.5,
    "body_seconds": 0.5,
    "answer_seconds": 1.0,
    "idle_seconds": 0.5,
    "body_bytes": 10_000,
}
HEALTH = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n"
LARGE = f"/assets/{assets_digest()}/plotly/plotly.min.js".encode()
LARGE_BYTES = ASSETS["plotly/plotly.min.js"].stat().st_size  # more than buffers of the kernel hold


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with serving(tmp_path_factory.mktemp("connected") / "store", **LIMITS) as address:
        yield address


@contextmanager
def connected(address: str, receive_buffer: int | None = None) -> Iterator[socket.socket]:
    parts = urlsplit(address)
    with socket.socket() as connection:
        if receive_buffer is not None:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        connection.settimeout(SECONDS)
        connection.connect((parts.hostname, parts.port))
        yield connection


def ends(connection: socket.socket, dripping: bytes = b"") -> bool:
    """Tell whether the service closes a connection to which a client goes on to send a little."""
    deadline = time.monotonic() + SECONDS
    connection.settimeout(0.1)
    while time.monotonic() < deadline:
        try:
            if dripping:
                connection.sendall(dripping)
            if not connection.recv(65536):
                return True
        except TimeoutError:
            continue
        except OSError:
            return True
    return False


@pytest.mark.parametrize(
    ("request_bytes", "dripping"),
    [
        (b"", b""),
        (b"GET /healthz HTTP/1.1\r\n", b"X: y\r\n"),
        (HEALTH + b"\r\n", b""),
        (HEALTH + b"\r\n", b"\r"),
        (HEALTH + b"\r\n", b"\r\n"),
        (HEALTH + b"Content-Length: 1000000\r\n\r\n", b""),
        (HEALTH + b"Content-Length: 1000000\r\n\r\n", b"x"),
        (HEALTH + b"Transfer-Encoding: chunked\r\n\r\n", b"1\r\nx\r\n"),
        (HEALTH + b"Transfer-Encoding: chunked\r\n\r\n0\r\n", b"X: y\r\n"),
        (HEALTH + b"Content-Length: 5\r\nExpect: 100-continue\r\n\r\n", b""),
        (HEALTH + b"Connection: Upgrade\r\nUpgrade: websocket\r\n\r\n", b"x"),
        (HEALTH + b"\r\n" + HEALTH, b"X: y\r\n"),
        (b"POST /jobs HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100\r\n\r\n", b"x"),
    ],
)
def test_no_connection_stays_open(address, request_bytes, dripping):
    with connected(address) as connection:
        connection.sendall(request_bytes)
        assert ends(connection, dripping)


@pytest.mark.parametrize("kept", [b"keep-alive", b"close"])
def test_an_answer_that_is_not_read_ends_the_connection(address, kept):
    with connected(address, receive_buffer=4096) as connection:
        request = b"GET %s HTTP/1.1\r\nHost: localhost\r\nConnection: %s\r\n\r\n" % (LARGE, kept)
        connection.sendall(request)
        time.sleep(4 * LIMITS["answer_seconds"])
        received = 0
        try:
            while piece := connection.recv(65536):
                received += len(piece)
        except ConnectionResetError:
            pass
        assert received < LARGE_BYTES, "what was not sent in time is not sent any more"


def test_an_answer_that_is_read_slowly_but_steadily_arrives_whole(address):
    whole = httpx2.get(f"{address}{LARGE.decode()}", headers={"Accept-Encoding": "identity"}).content
    with connected(address) as connection:
        connection.sendall(b"GET %s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n" % LARGE)
        received = bytearray()
        while piece := connection.recv(65536):
            received += piece
            time.sleep(0.03)
        assert received.endswith(whole[-1000:])
        assert len(received) > len(whole)


@pytest.mark.parametrize(
    ("request_bytes", "endless"),
    [
        (HEALTH + b"Content-Length: 1000000000\r\n\r\n", b"x" * 1000),
        (HEALTH + b"Transfer-Encoding: chunked\r\n\r\n", b"3e8\r\n" + b"x" * 1000 + b"\r\n"),
        (HEALTH + b"Transfer-Encoding: chunked\r\n\r\n0\r\n", b"X: " + b"y" * 1000 + b"\r\n"),
        (HEALTH + b"Transfer-Encoding: chunked\r\n\r\n1;", b"y" * 1000),
    ],
)
def test_what_follows_a_head_is_limited_in_size(tmp_path, request_bytes, endless):
    limits = LIMITS | {"body_seconds": 1000.0}
    with serving(tmp_path / "store", **limits) as address, connected(address) as connection:
        connection.sendall(request_bytes)
        sent = 0
        with suppress(ConnectionError):
            while sent < 20_000_000:
                connection.sendall(endless)
                sent += len(endless)
                time.sleep(0.0001)
        assert sent < 20_000_000, "the service has not closed the connection"


def test_requests_one_after_the_other_are_answered(address):
    """Limits of a request do not add up over the requests of a connection."""
    with httpx2.Client(base_url=address) as client:
        for _ in range(50):
            body = {"preset": "doublet-shear", "set": {"flow.kind": "x" * 5000}}
            assert client.post("/estimate", json=body).status_code == 422


def test_a_client_may_listen_for_longer_than_any_limit(store):
    with serving(store, **LIMITS, event_seconds=0.1) as address:
        job = httpx2.post(f"{address}/jobs", json={"preset": "doublet-shear"}, timeout=SECONDS).json()
        with connected(address) as connection:
            connection.sendall(f"GET /jobs/{job['id']}/events HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
            time.sleep(5 * LIMITS["answer_seconds"])
            httpx2.delete(f"{address}/jobs/{job['id']}", timeout=SECONDS)
            received = b""
            while b"dismissed" not in received:
                received += connection.recv(65536)


def test_connections_that_do_nothing_leave_room_for_others(store):
    """Each keeps its place for a short time only, in whichever phase it is."""
    token = make_token(store, "ada", TokenScope.READ)
    with serving(store, **LIMITS, connections=20) as address:
        holding = [connected(address) for _ in range(30)]
        opened = [held.__enter__() for held in holding]
        for connection in opened:
            connection.sendall(HEALTH + b"Content-Length: 1000000\r\n\r\nx")
        headers = {"Authorization": f"Bearer {token}"}
        deadline = time.monotonic() + SECONDS
        while httpx2.get(f"{address}/jobs", headers=headers).status_code != 200:
            assert time.monotonic() < deadline
            time.sleep(0.1)
        for held in holding:
            held.__exit__(None, None, None)
