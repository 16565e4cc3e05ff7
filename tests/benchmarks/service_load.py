"""Measures the service on the loopback: ``python -m tests.benchmarks.service_load``.

A real server process answers from a store with many jobs, to listeners to the events of a job as well and,
with ``--busy``, beside a job under MPI; the program wrk asks.  Prints, as JSON, requests a second, the 99th
percentile of their time, refusals and, since it depends least on what else the machine does, the server's
processor time a request.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx2
import psutil
from sqlalchemy import insert

from api.database.database_tables import JobRow
from api.database.service_database import Database
from api.jobs.job import JobStatus
from api.jobs.job_queue import Jobs
from api.settings import Settings
from ensemble.questions import preset_question
from ensemble.store import Store
from tests.api.stores import fill

BATCH = 5000
CONNECTIONS = 32
SETTLE_SECONDS = 8  # in which the server has warmed up and the job has begun to compute
UNLIMITED = {
    "ENSEMBLE_REQUEST_RATE": "1000000/second",
    "ENSEMBLE_SUBMISSION_RATE": "1000000/second",
    "ENSEMBLE_MAXIMUM_JOBS": "10000000",
}
ENDLESS = {"preset": "critical-hamaker", "set": {"search.tolerance": 1e-6}, "ranks": 1}
POST = """
wrk.method = "POST"
wrk.body = '{"preset": "doublet-shear"}'
wrk.headers["Content-Type"] = "application/json"
"""
ANOTHER = """
local turn = 0
request = function()
  turn = turn + 1
  local change = string.format('"set": {"flow.rate": %.6f}', 0.4 + 1e-6 * turn)
  return wrk.format(nil, nil, nil, '{"preset": "doublet-shear", ' .. change .. '}')
end
"""
TO_MILLISECONDS = {"us": 1e-3, "ms": 1.0, "s": 1e3}


def fill_queue(store: Path, count: int) -> list[str]:
    """Put finished jobs into the database; gives some of their identifiers."""
    with Database.open(Settings(store=store).database_url, store) as database:
        jobs = Jobs(database, store)
        job = jobs.result(jobs.submit(preset_question("doublet-shear", {}), "ada", 1, 60.0)).job
        row = job.model_dump() | {
            "document": {},
            "fingerprint": "",
            "idempotency_key": None,
            "status": JobStatus.SUCCEEDED,
        }
        identifiers = [f"{number:032x}" for number in range(count)]
        for start in range(0, count, BATCH):
            rows = [row | {"id": identifier} for identifier in identifiers[start : start + BATCH]]
            with database.begin() as connection:
                connection.execute(insert(JobRow), rows)
    return identifiers[:: max(count // 100, 1)]


@contextmanager
def server(store: Path, workers: int) -> Iterator[tuple[psutil.Process, str]]:
    """Start a server process; gives it and its address."""
    said = store.with_name("said")
    command = [sys.executable, "-m", "ensemble", "serve", "--port=0", f"--workers={workers}"]
    with said.open("wb") as log:
        process = subprocess.Popen(
            [*command, f"--store={store}"], stdout=log, stderr=log, env=os.environ | UNLIMITED
        )
    try:
        while not (found := re.search(r"running on (http://\S+)", said.read_text(encoding="utf-8"))):
            if process.poll() is not None:
                sys.exit(said.read_text(encoding="utf-8"))
            time.sleep(0.1)
        yield psutil.Process(process.pid), found[1]
    finally:
        process.terminate()
        process.wait()


@contextmanager
def listening(address: str, path: str, listeners: int) -> Iterator[None]:
    """Listen over so many connections, from a thread."""
    parts = urlsplit(address)
    request = f"GET {path} HTTP/1.1\r\nHost: {parts.netloc}\r\n\r\n".encode()
    ready = threading.Barrier(2)
    loop = asyncio.new_event_loop()

    async def listen() -> None:
        connections = [await asyncio.open_connection(parts.hostname, parts.port) for _ in range(listeners)]
        for reader, writer in connections:
            writer.write(request)
            await reader.readuntil(b"event: job")
        ready.wait()
        await asyncio.gather(*(reader.read() for reader, _ in connections))

    thread = threading.Thread(target=lambda: loop.run_until_complete(listen()), daemon=True)
    thread.start()
    ready.wait(60)
    yield
    assert thread.is_alive(), "the listeners were sent away"


def processor_seconds(process: psutil.Process) -> float:
    """Processor time that a process has used."""
    used = process.cpu_times()
    return used.user + used.system


def ask(directory: Path, process: psutil.Process, address: str, seconds: int, script: str) -> dict[str, Any]:
    """Send requests over many connections at once."""
    file = directory / "requests.lua"
    file.write_text(script, encoding="utf-8")
    command = ["wrk", "-t1", f"-c{CONNECTIONS}", f"-d{seconds}s", "--latency", f"--script={file}", address]
    before = processor_seconds(process)
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    used = processor_seconds(process) - before
    count = re.search(r"(\d+) requests in", text)
    rate = re.search(r"Requests/sec:\s+([\d.]+)", text)
    slow = re.search(r"99%\s+([\d.]+)(us|ms|s)", text)
    refused = re.search(r"Non-2xx or 3xx responses: (\d+)", text)
    assert count is not None, text
    assert rate is not None, text
    assert slow is not None, text
    return {
        "per_second": float(rate[1]),
        "processor_milliseconds": 1e3 * used / int(count[1]),
        "p99_milliseconds": float(slow[1]) * TO_MILLISECONDS[slow[2]],
        "refused": int(refused[1]) if refused else 0,
    }


def getting(*paths: str) -> str:
    """A script that asks for one path after the other."""
    listed = ", ".join(f'"{path}"' for path in paths)
    return f"""
local paths = {{ {listed} }}
local turn = 0
request = function()
  turn = turn % #paths + 1
  return wrk.format("GET", paths[turn])
end
"""


def main() -> None:
    """Print the measurement."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=100_000, help="in the store")
    parser.add_argument("--seconds", type=int, default=10, help="for each kind of request")
    parser.add_argument("--listeners", type=int, default=100, help="to the events of a job")
    parser.add_argument("--busy", action="store_true", help="beside a job of one rank")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        directory = Path(temporary)
        store = fill(directory / "store")
        identifiers = fill_queue(store, options.jobs)
        with Store.existing(store) as opened:
            runs = [summary.key for summary in opened.summaries()]
            (boundary,) = (boundary.study_key for boundary in opened.boundaries())
        scripts = {
            "GET /jobs/{id}": getting(*(f"/jobs/{identifier}" for identifier in identifiers)),
            "GET /jobs?limit=20": getting("/jobs?limit=20"),
            "GET /runs/{key}": getting(*(f"/runs/{key}" for key in runs)),
            "GET /boundaries/{key}": getting(f"/boundaries/{boundary}"),
            "POST /jobs": POST,
            "POST /jobs, each of another scene": POST + ANOTHER,
        }
        with server(store, workers=int(options.busy)) as (process, address):
            listened = httpx2.post(f"{address}/jobs", json=ENDLESS).raise_for_status().json()["id"]
            time.sleep(SETTLE_SECONDS)
            with listening(address, f"/jobs/{listened}/events", options.listeners):
                measured = {
                    name: ask(directory, process, f"{address}/jobs", options.seconds, script)
                    for name, script in scripts.items()
                }
    load = os.getloadavg()[0]
    print(json.dumps({"jobs": options.jobs, "busy": options.busy, "load": load} | measured, indent=2))


if __name__ == "__main__":
    main()
