"""Takes the database or the disk away from a service at random moments of jobs, and counts what it costs.

    python -m tests.benchmarks.outages DIRECTORY --kind database --seconds 10 --count 50

Jobs are submitted all the time, each with a key of its own.  ``database`` stops a PostgreSQL server and
starts it again; ``frozen`` suspends its processes; ``disk`` fills the file system of the store, a small one
in memory, and ``read-only`` lets nothing be opened for writing there.  Several runs may go on beside each
other: each has its own servers.  The figures are printed as JSON.  Mounting needs the rights of root.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import partial
from pathlib import Path

import httpx2
import psutil

from api.jobs.job import Job, JobStatus
from ensemble.store import Store
from tests import postgresql
from tests.api.services import StartedService, service
from tests.benchmarks.kills import created, queue, wait_for
from tests.full_disks import filled, small_disk

ROOM = "size=256m"
AHEAD = 3  # jobs that wait
BETWEEN = (0.0, 4.0)  # seconds from the end of an outage to the next

Outage = Callable[[], AbstractContextManager[None]]


class Submitting:
    """A client that submits until told to stop, and asks again with the same key after every 503."""

    def __init__(self, started: StartedService) -> None:
        self._http = httpx2.Client(base_url=started.url, timeout=120)
        self._stop = threading.Event()
        self.acknowledged: list[str] = []
        self.other_answers: list[str] = []
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def stop(self) -> None:
        """Finish what is being asked."""
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        number = 0
        while not self._stop.is_set():
            if self._waiting() >= AHEAD:
                time.sleep(0.2)
                continue
            number += 1
            changes = {"numerics.points": 32, "numerics.tolerance": 1e-4, "flow.rate": 0.4 + 1e-4 * number}
            body = {"preset": "doublet-shear", "set": changes, "ranks": 1 + number % 2}
            key = {"Idempotency-Key": f"job-{number}"}
            answer = self._insist("POST", "/jobs", json=body, headers=key)
            self.acknowledged.append(answer.json()["id"])

    def _waiting(self) -> int:
        return len(self._insist("GET", "/jobs", params={"status": "accepted"}).json()["items"])

    def _insist(self, method: str, path: str, **options: object) -> httpx2.Response:
        while True:
            answer = self._http.request(method, path, **options)  # type: ignore[arg-type]
            if answer.is_success:
                return answer
            if answer.status_code != httpx2.codes.SERVICE_UNAVAILABLE or "retry-after" not in answer.headers:
                self.other_answers.append(f"{method} {path}: {answer.status_code} {answer.text[:200]}")
            time.sleep(0.2)


@contextmanager
def stopped(server: postgresql.Server) -> Iterator[None]:
    """A server that does not run."""
    server.stop()
    try:
        yield
    finally:
        server.start()


@contextmanager
def read_only(disk: Path) -> Iterator[None]:
    """A disk on which nothing can be opened for writing. What is open already can be written to."""
    # The kernel keeps a mount writable while a file on it is open for writing, so another is put over it.
    subprocess.run(["mount", "--bind", "-o", "ro", disk, disk], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", disk], check=True)


def outages_of(kind: str, directory: Path, stack: ExitStack) -> tuple[Path, Outage]:
    """Prepare what is taken away; gives the store and what takes it away as long as a block runs."""
    if kind in ("database", "frozen"):
        programs = postgresql.programs()
        if programs is None:
            raise SystemExit("outages: PostgreSQL is not installed")
        server = stack.enter_context(postgresql.running(programs))
        os.environ["ENSEMBLE_DATABASE"] = server.new_database()
        return directory / "store", server.suspended if kind == "frozen" else partial(stopped, server)
    disk = stack.enter_context(small_disk(directory / "disk", ROOM))
    return disk / "store", partial({"disk": filled, "read-only": read_only}[kind], disk)


def repeat(outage: Outage, options: argparse.Namespace, chance: random.Random) -> int:
    """Take it away so many times, unless time is over; gives how often."""
    deadline = time.monotonic() + 60 * options.minutes
    for number in range(options.count):
        time.sleep(chance.uniform(*BETWEEN))
        if time.monotonic() > deadline:
            return number
        with outage():
            time.sleep(options.seconds)
        print(f"{options.kind} {options.seconds:g} s: {number + 1}", file=sys.stderr)
    return int(options.count)


def figures(kept: Mapping[str, Job], load: Submitting) -> dict[str, object]:
    """Count what has become of the jobs."""
    names = load.acknowledged
    return {
        "acknowledged": len(names),
        "lost": len(set(names) - kept.keys()),
        "not succeeded": [
            f"{kept[name].status}: {kept[name].message}"
            for name in names
            if name in kept and kept[name].status != JobStatus.SUCCEEDED
        ],
        "jobs beyond those acknowledged": len(kept.keys() - set(names)),
        "keys with two jobs": len(kept) - len({job.key for job in kept.values()}),
        "attempts": sum(job.attempts for job in kept.values()),
        "answers other than 2xx and 503 with Retry-After": load.other_answers[:10],
    }


def main() -> None:
    """Take away, count and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory", type=Path)
    parser.add_argument("--kind", choices=("database", "frozen", "disk", "read-only"), required=True)
    parser.add_argument("--seconds", type=float, default=10.0, help="of each outage")
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--minutes", type=float, default=600.0, help="after which fewer are enough")
    parser.add_argument("--seed", type=int, default=15)
    options = parser.parse_args()
    options.directory.mkdir(parents=True)
    with ExitStack() as stack:
        store, outage = outages_of(options.kind, options.directory, stack)
        Store.open(store).close()
        with service(store, "--workers=1") as started:
            load = Submitting(started)
            try:
                done = repeat(outage, options, random.Random(options.seed))
            finally:
                load.stop()
            with queue(store) as jobs:
                wait_for(lambda: all(jobs.get(name).status.finished for name in load.acknowledged))
                kept = {job.id: job for job in jobs.latest(100_000)}
            resident = psutil.Process(started.process.pid).memory_info().rss
        with Store.open(store) as opened:
            torn = opened.check()
        counted = figures(kept, load) | {"runs": len(created(store)), "torn": torn, "server bytes": resident}
    head = {"kind": options.kind, "seconds": options.seconds, "outages": done}
    print(json.dumps(head | counted, indent=2))


if __name__ == "__main__":
    main()
