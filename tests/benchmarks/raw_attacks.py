"""Sends made-up bytes to the service: ``python -m tests.benchmarks.raw_attacks``.

Requests are put together from valid and invalid parts, and clients behave badly after them: they are silent,
drip, never read, close a half.  Prints how many answers of each status there were, how many connections
stayed open, and the memory of the server before, at its largest and after.  The exit status is 0 only if
there was no server error, no connection stayed open and the server still answers.
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
SECONDS = 60  # after which a connection counts as one that stays open; the limits are far shorter
LIMITS = {
    "HEADER_SECONDS": 1,
    "BODY_SECONDS": 1,
    "ANSWER_SECONDS": 2,
    "IDLE_SECONDS": 1,
    "EVENT_SECONDS": 0.2,
}
METHODS = [b"GET"] * 6 + [
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
VERSIONS = [b"HTTP/1.1"] * 6 + [b"HTTP/1.0", b"HTTP/2.0", b"HTTP/9.9", b"", b"HTTP/1.1 extra"]
HOSTS = [b"Host: localhost"] * 6 + [
    b"",
    b"Host: evil.example",
    b"Host: localhost\r\nHost: b",
    b"Host: " + b"h" * 9000,
]
HEADERS = [
    b"",
    b"",
    b"",
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
    b"",
    b"",
    b"{",
    b'{"preset":"doublet-shear"}',
    b"0\r\n\r\n",
    b"5\r\nhello\r\n",
    b"ffffffffffffffff\r\n",
    b"x" * 99_999,
]
BEHAVIOURS = ("close", "wait", "drip", "never read", "half", "again")


def request(choose: random.Random) -> bytes:
    """Return the bytes of a request."""
    head = b" ".join([choose.choice(METHODS), choose.choice(TARGETS), choose.choice(VERSIONS)])
    lines = [head, choose.choice(HOSTS), choose.choice(HEADERS), choose.choice(HEADERS)]
    return b"\r\n".join(line for line in lines if line) + b"\r\n\r\n" + choose.choice(BODIES)


def attack(port: int, data: bytes, behaviour: str) -> tuple[int, bool]:
    """Send bytes; give the status of the answer (0: none) and whether the service ended the connection."""
    answer, ended = b"", behaviour == "close"
    with socket.create_connection(("127.0.0.1", port), timeout=SECONDS) as connection:
        try:
            connection.sendall(data * (20 if behaviour == "again" else 1))
            if behaviour == "half":
                connection.shutdown(socket.SHUT_WR)
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
    for data, behaviour in stayed:
        print(behaviour, data[:200])
    sys.exit(0 if alive and not errors and not stayed and not report["tracebacks"] else 1)


if __name__ == "__main__":
    main()
