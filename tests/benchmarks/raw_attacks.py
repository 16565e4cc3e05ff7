"""Sends made-up bytes to the service: ``python -m tests.benchmarks.raw_attacks``.

Requests are put together from valid and invalid parts, in valid and invalid frames, and clients behave badly:
they send byte by byte or twenty at once, are silent, drip, never read, close a half.  Prints how many answers
of each status there were, how many connections stayed open, and the memory of the server before, at its
largest and after.  The exit status is 0 only if there was no server error, no connection stayed open and the
server still answers.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import socket
import sys
import tempfile
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx2
import psutil

from tests.api.services import StartedService, service
from tests.api.stores import fill

AT_ONCE = 30
SINGLE_BYTES = 500  # of a request that is sent byte by byte
SECONDS = 60  # after which a connection counts as one that stays open; the limits are far shorter
LIMITS = {
    "HEADER_SECONDS": 1,
    "BODY_SECONDS": 1,
    "ANSWER_SECONDS": 2,
    "IDLE_SECONDS": 1,
    "EVENT_SECONDS": 0.2,
}
PLAIN = 0.75  # how often a part of a head is as clients send it
METHODS = [
    b"POST",
    b"DELETE",
    b"HEAD",
    b"OPTIONS",
    b"TRACE",
    b"CONNECT",
    b"get",
    b"G\0T",
    b"X" * 99,
]
TARGETS = [
    b"/",
    b"/healthz",
    b"/readyz",
    b"/jobs",
    b"/runs",
    b"/presets",
    b"/openapi.json",
    b"/metrics",
    b"//",
    b"*",
    b"/jobs?limit=99999999999999999999",
    b"/runs?where=a%3Db" + b"+" * 31_000 + b"%0A",
    b"/runs/%00/frames",
    b"/runs?where=flow.rate%3E%3D" + b"9" * 900,
    b"/runs?" + b"where=a&" * 3000,
    b"/jobs/%ff%fe/events",
    b"/boundaries/" + b"0" * 16 + b"/at?" + b"x=1&" * 5000,
    b"http://evil.example/jobs",
    b"/" + b"a" * 31_000,
    b"/assets/..%2f..%2fetc/passwd",
    b"/runs/" + b"0" * 32 + b"/series?name=" + b"n" * 9000,
    b"/jobs?after=%0a",
    b"/runs/" + b"f" * 32 + b"/frames?start=999999999&stop=1&stride=1000000000",
    b"/kinds",
    b"/flows",
    b"/\xff",
]
VERSIONS = [b"HTTP/1.0", b"HTTP/2.0", b"HTTP/9.9", b"", b"HTTP/1.1 extra"]
HOSTS = [
    b"",
    b"Host: evil.example",
    b"Host: localhost\r\nHost: b",
    b"Host: " + b"h" * 9000,
]
HEADERS = [
    b"Content-Length: 1000000",
    b"Content-Length: 5",
    b"Content-Length: -1",
    b"Content-Length: 1e3",
    b"Content-Length: 5\r\nContent-Length: 6",
    b"Transfer-Encoding: chunked",
    b"Transfer-Encoding: gzip, chunked",
    b"Transfer-Encoding: chunked\r\nContent-Length: 3",
    b"Expect: 100-continue\r\nContent-Length: 9",
    b"Connection: Upgrade\r\nUpgrade: websocket",
    b"Connection: close",
    b"Connection: keep-alive, close",
    b"Accept: application/octet-stream",
    b"Accept-Encoding: gzip;q=0",
    b"If-None-Match: " + b'"a",' * 5000,
    b"Authorization: Bearer " + b"t." * 9000,
    b"X: \x80\xff",
    b"X: a\0b",
    b"X:" + b" " * 20_000,
    b"X" * 40_000,
    b"Origin: null",
    b"Sec-Fetch-Site: cross-site",
    b"X-Forwarded-For: 127.0.0.1",
    b"Range: bytes=0-1,2-3",
    b"Idempotency-Key: " + b"k" * 9000,
    b"Cookie: " + b"a=b;" * 5000,
    b"Content-Type: application/json",
]
BODIES = [
    b"{",
    b'{"preset":"doublet-shear"}',
    b'{"preset":"doublet-shear","set":{"horizon":1e999}}',
    b'{"preset":"doublet-shear","set":{"flow.rate":NaN}}',
    b'{"preset":"doublet-shear","set":{"' + b"a." * 40_000 + b'":1}}',
    b'{"preset":"doublet-shear","ranks":' + b"9" * 5000 + b"}",
    b'{"preset":"doublet-shear","preset":"vesicle-shear"}',
    b'{"preset":"\\ud800"}',
    b'\xef\xbb\xbf{"preset":"doublet-shear"}',
    b'{"preset":"\xff\xfe"}',
    b"[" * 50_000,
    b'{"scene":' * 9000,
    b"x" * 99_999,
]


def exact(body: bytes) -> tuple[bytes, bytes]:
    """A header and a body after it, as clients send them."""
    return b"Content-Length: %d" % len(body), body


def short(body: bytes) -> tuple[bytes, bytes]:
    """The rest of the body is the beginning of a request."""
    return b"Content-Length: %d" % (len(body) // 2), body


def long(body: bytes) -> tuple[bytes, bytes]:
    """The body never arrives as a whole."""
    return b"Content-Length: %d" % (2 * len(body) + 1), body


def chunked(body: bytes) -> tuple[bytes, bytes]:
    """In chunks of seven bytes at most."""
    pieces = [body[start : start + 7] for start in range(0, min(len(body), 7000), 7)]
    chunks = (b"%x\r\n%s\r\n" % (len(piece), piece) for piece in pieces)
    return b"Transfer-Encoding: chunked", b"".join(chunks) + b"0\r\n\r\n"


def endless(body: bytes) -> tuple[bytes, bytes]:
    """In chunks of which the last never comes, with something after the size."""
    return b"Transfer-Encoding: chunked", b"%x;a=b\r\n%s\r\n" % (len(body), body)


def torn(body: bytes) -> tuple[bytes, bytes]:
    """In chunks whose sizes are none."""
    return b"Transfer-Encoding: chunked", b"fffffffffffffffff\r\n" + body + b"-1\r\nzz\r\n"


def bare(body: bytes) -> tuple[bytes, bytes]:
    """Without a word about it."""
    return b"", body


FRAMINGS = (exact, exact, short, long, chunked, endless, torn, bare)
BEHAVIOURS = ("close", "wait", "drip", "never read", "half", "again", "bytes")


def request(choose: random.Random) -> bytes:
    """Return the bytes of a request, most parts of which are as clients send them."""

    def part(plain: bytes, others: list[bytes]) -> bytes:
        return plain if choose.random() < PLAIN else choose.choice(others)

    if choose.random() < 0.5:
        method, target = part(b"GET", METHODS), choose.choice(TARGETS)
        framing, body = b"", b""
    else:
        method, target = part(b"POST", METHODS), part(choose.choice([b"/jobs", b"/estimate"]), TARGETS)
        framing, body = choose.choice(FRAMINGS)(choose.choice(BODIES))
    lines = [
        b" ".join([method, target, part(b"HTTP/1.1", VERSIONS)]),
        part(b"Host: localhost", HOSTS),
        part(b"Content-Type: application/json", HEADERS),
        part(b"Accept: */*", HEADERS),
        framing,
    ]
    return b"\r\n".join(line for line in lines if line) + b"\r\n\r\n" + body


def send(connection: socket.socket, data: bytes, behaviour: str) -> None:
    """Send a request at once, byte by byte, twenty times, or as the last one."""
    if behaviour == "bytes":
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for octet in data[:SINGLE_BYTES]:
            connection.sendall(bytes([octet]))
        data = data[SINGLE_BYTES:]
    connection.sendall(data * (20 if behaviour == "again" else 1))
    if behaviour == "half":
        connection.shutdown(socket.SHUT_WR)


def attack(port: int, data: bytes, behaviour: str) -> tuple[int, bool]:
    """Send bytes; give the status of the answer (0: none) and whether the service ended the connection."""
    answer, ended = b"", behaviour == "close"
    with socket.create_connection(("127.0.0.1", port), timeout=SECONDS) as connection:
        try:
            send(connection, data, behaviour)
            connection.settimeout(0.2)
            deadline = time.monotonic() + (0.5 if behaviour == "close" else SECONDS)
            if behaviour == "never read":
                time.sleep(8)  # far longer than all limits together
            while time.monotonic() < deadline:
                try:
                    if behaviour == "drip":
                        connection.sendall(b"x")
                    if not (piece := connection.recv(1 << 16)):
                        ended = True
                        break
                    answer += piece[: 100 - len(answer)]
                except TimeoutError:
                    continue
        except OSError:
            ended = True
    words = answer.split(b" ", 2)
    return (int(words[1]) if len(words) > 2 and words[1].isdigit() else 0), ended


def memory(server: StartedService) -> float:
    """Return the memory of a server in MB."""
    return float(psutil.Process(server.process.pid).memory_info().rss / 1e6)


def main() -> None:
    """Print the counts as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    choose = random.Random(options.seed)
    cases = [(request(choose), BEHAVIOURS[number % len(BEHAVIOURS)]) for number in range(options.count)]
    os.environ.update({f"ENSEMBLE_{name}": str(value) for name, value in LIMITS.items()})
    with (
        tempfile.TemporaryDirectory() as directory,
        service(fill(Path(directory) / "store"), "--workers=0") as server,
    ):
        largest, stop = [before := memory(server)], threading.Event()

        def watch() -> None:
            while not stop.wait(0.05):
                largest.append(memory(server))

        threading.Thread(target=watch, daemon=True).start()
        with ThreadPoolExecutor(AT_ONCE) as pool:
            results = list(pool.map(lambda case: attack(server.port, *case), cases))
        alive = httpx2.get(f"{server.url}/runs", timeout=SECONDS).status_code == 200
        stop.set()
        after = memory(server)
        logged = server.logged()
    statuses = Counter(status for status, _ in results)
    stayed = [case for case, (_, ended) in zip(cases, results, strict=True) if not ended]
    errors = sum(number for status, number in statuses.items() if status >= 500)
    report = {
        "requests": len(results),
        "statuses": dict(sorted(statuses.items())),
        "server errors": errors,
        "tracebacks": logged.count("Traceback"),
        "connections that stayed open": len(stayed),
        "MB before, at most, after": [round(value) for value in (before, max(largest), after)],
    }
    print(json.dumps(report, indent=2))
    if report["tracebacks"]:
        print(logged)
    for data, behaviour in stayed:
        print(behaviour, data[:200])
    sys.exit(0 if alive and not errors and not stayed and not report["tracebacks"] else 1)


if __name__ == "__main__":
    main()
