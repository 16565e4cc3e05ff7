"""Kills parts of a service under load and counts what was lost, repeated, torn or left behind.

    python -m tests.benchmarks.kills --kills 50 DIRECTORY

Jobs are submitted all the time, and read by two more clients.  Each victim in turn (the server, the worker,
`mpirun`, a rank) is killed with SIGKILL at a random moment of a running job, so many times.  A server that is
killed is started again here, a worker by its server.  The figures are printed as JSON.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import fmean
from typing import Any
from uuid import uuid4

import httpx2
import psutil

from api.database.service_database import Database
from api.jobs.job import Job, JobStatus
from api.jobs.job_queue import Jobs
from api.settings import Settings
from ensemble.store import Store
from tests.api.processes import alive

MARK = "ENSEMBLE_BENCHMARK_FAMILY"
VICTIMS = ("server", "worker", "mpirun", "rank")
PATIENCE = 600.0  # a machine may be busy with other things
READERS = 2
AHEAD = 3  # jobs that wait


class Service:
    """`ensemble serve`, started again whenever it is killed."""

    def __init__(self, store: Path, port: int) -> None:
        self.mark = uuid4().hex
        self.address = f"http://127.0.0.1:{port}"
        self._command = [
            sys.executable,
            "-m",
            "ensemble",
            "serve",
            f"--port={port}",
            f"--store={store}",
        ]
        self._log = (store.parent / "service.log").open("ab")
        self.start()

    def start(self) -> None:
        """Start the server."""
        self.server = subprocess.Popen(
            self._command, env=os.environ | {MARK: self.mark}, stdout=self._log, stderr=self._log
        )

    def members(self) -> list[psutil.Process]:
        """Every process that has come of the service."""
        return alive([process for process in psutil.process_iter() if self._has_mark(process)])

    def _has_mark(self, process: psutil.Process) -> bool:
        try:
            return process.environ().get(MARK) == self.mark
        except psutil.Error:
            return False

    def find(self, victim: str) -> psutil.Process | None:
        """The process that plays this part at the moment."""
        return next((process for process in self.members() if _plays(process, victim)), None)

    def stop(self) -> None:
        """End it in order."""
        self.server.send_signal(signal.SIGTERM)
        self.server.wait()
        self._log.close()


def _plays(process: psutil.Process, part: str) -> bool:
    try:
        command, environment = process.cmdline(), process.environ()
    except psutil.Error:
        return False
    if part == "rank":
        return environment.get("PMI_RANK") == "0" and "api.worker.background" in command
    if part == "mpirun":
        return process.name().startswith("mpi")
    words = [word for word in command if word != "-P"]
    return words[1:4] == ["-m", "ensemble", {"server": "serve", "worker": "worker"}[part]]


class Load:
    """Clients that submit and read until told to stop; every acknowledged job is remembered."""

    def __init__(self, address: str, jobs: Jobs) -> None:
        self._address = address
        self._jobs = jobs
        self._stop = threading.Event()
        self.acknowledged: list[str] = []
        self.reads = 0
        self._threads = [threading.Thread(target=self._submit)]
        self._threads += [threading.Thread(target=self._read) for _ in range(READERS)]
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Finish what is being asked."""
        self._stop.set()
        for thread in self._threads:
            thread.join()

    def _submit(self) -> None:
        number = 0
        while not self._stop.is_set():
            if self._jobs.counts()[JobStatus.ACCEPTED] >= AHEAD:
                time.sleep(0.05)
                continue
            number += 1
            self.acknowledged.append(self._insist(number))

    def _insist(self, number: int) -> str:
        """Ask with one key until there is an answer, as a client does whose server is killed."""
        changes = {"numerics.points": 32, "numerics.tolerance": 1e-4, "flow.rate": 0.4 + 1e-4 * number}
        body = {"preset": "doublet-shear", "set": changes, "ranks": 1 + number % 2}
        while True:
            try:
                answer = httpx2.post(
                    f"{self._address}/jobs", json=body, headers={"Idempotency-Key": f"job-{number}"}
                )
                return str(answer.raise_for_status().json()["id"])
            except httpx2.TransportError:
                time.sleep(0.05)

    def _read(self) -> None:
        while not self._stop.is_set():
            try:
                httpx2.get(f"{self._address}/jobs").raise_for_status()
                self.reads += 1
            except httpx2.TransportError:
                time.sleep(0.05)


def wait_for(condition: Callable[[], Any]) -> float:
    """Wait until something is true and return the seconds it took."""
    begin = time.monotonic()
    while not condition():
        if time.monotonic() - begin > PATIENCE:
            raise TimeoutError("it has not come about")
        time.sleep(0.1)  # to look at all processes takes a while itself
    return time.monotonic() - begin


def created(store: Path) -> dict[str, str]:
    """When each run of the store was made."""
    with Store.existing(store) as opened:
        return {summary.key: summary.created.isoformat() for summary in opened.summaries()}


def kill_once(service: Service, jobs: Jobs, victim: str, chance: random.Random) -> dict[str, float]:
    """Kill a victim while a job runs.

    Returns
    -------
    dict
        Seconds until all processes of the job were `gone`, and from the start of the worker that took over
        until the job was `resumed`.  Empty if the job had ended by then.
    """
    if chance.random() < 0.25:
        # A service in which no job ever comes to its end would show little.
        finished = _finished(jobs)
        wait_for(lambda: _finished(jobs) > finished)
    wait_for(lambda: service.find("mpirun"))
    time.sleep(chance.uniform(0, 3.0))
    wait_for(lambda: jobs.latest(1, status=JobStatus.RUNNING) and service.find(victim))
    (job,) = jobs.latest(1, status=JobStatus.RUNNING) or [None]
    spared = {"server"} if victim in ("server", "worker") else {"server", "worker"}
    old = [process for process in service.members() if not any(_plays(process, part) for part in spared)]
    found = service.find(victim)
    if job is None or found is None:
        return {}
    found.send_signal(signal.SIGKILL)
    took = {"gone": wait_for(lambda: not alive(old))}
    if victim == "server":
        service.server.wait()
        service.start()
    wait_for(lambda: service.find("worker"))
    return took | {"resumed": wait_for(lambda: _goes_on(jobs.get(job.id), job))}


def _finished(jobs: Jobs) -> int:
    return sum(count for status, count in jobs.counts().items() if status.finished)


def _goes_on(job: Job, before: Job) -> bool:
    return job.status.finished or job.attempts > before.attempts


@contextmanager
def queue(store: Path) -> Iterator[Jobs]:
    """Read the queue of a store."""
    with Database.open(Settings(store=store).database_url, store) as database:
        yield Jobs(database, store)


def main() -> None:
    """Kill, count and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory", type=Path)
    parser.add_argument("--kills", type=int, default=50, help="of each")
    parser.add_argument("--victims", nargs="+", choices=VICTIMS, default=VICTIMS)
    parser.add_argument("--seed", type=int, default=6)
    parser.add_argument("--minutes", type=float, default=600.0, help="after which fewer kills are enough")
    parser.add_argument("--port", type=int, default=8123)
    options = parser.parse_args()
    options.directory.mkdir(parents=True)
    store = options.directory / "store"
    Store.open(store).close()
    chance = random.Random(options.seed)
    took: dict[str, list[dict[str, float]]] = {victim: [] for victim in options.victims}
    remade = 0
    with queue(store) as jobs:
        service = Service(store, options.port)
        load = Load(service.address, jobs)
        known: dict[str, str] = {}
        deadline = time.monotonic() + 60 * options.minutes
        while any(len(kills) < options.kills for kills in took.values()) and time.monotonic() < deadline:
            for victim in options.victims:
                if kill := kill_once(service, jobs, victim, chance):
                    took[victim].append(kill)
                present = created(store)
                remade += sum(present.get(key) != moment for key, moment in known.items())
                known = present
            print({victim: len(kills) for victim, kills in took.items()}, file=sys.stderr)
        load.stop()
        wait_for(lambda: all(jobs.get(name).status.finished for name in load.acknowledged))
        kept = {job.id: job for job in jobs.latest(100_000)}
        service.stop()
        with Store.open(store) as opened:
            torn = opened.check()
        runs = created(store)
    figures = {
        "acknowledged": len(load.acknowledged),
        "reads": load.reads,
        "lost": len(set(load.acknowledged) - kept.keys()),
        "not succeeded": [
            kept[name].message for name in load.acknowledged if kept[name].status != JobStatus.SUCCEEDED
        ],
        "jobs beyond those acknowledged": len(kept.keys() - set(load.acknowledged)),
        "keys with two jobs": len(kept) - len({job.key for job in kept.values()}),
        "runs": len(runs),
        "runs made again": remade,
        "torn": torn,
        "processes left": len(service.members()),
        "attempts": sum(job.attempts for job in kept.values()),
        "kills": {
            victim: {"times": len(kills)}
            | {f"most seconds until {what}": max(kill[what] for kill in kills) for what in kills[0]}
            | {f"mean seconds until {what}": fmean(kill[what] for kill in kills) for what in kills[0]}
            for victim, kills in took.items()
        },
    }
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
