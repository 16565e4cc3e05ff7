"""Kills parts of a service under load and counts what was lost, repeated, torn or left behind.

    python -m tests.benchmarks.kills --kills 50 DIRECTORY
    python -m tests.benchmarks.kills --kills 20 --launcher slurm DIRECTORY

Jobs are submitted all the time, and read by two more clients.  Each victim in turn (the server, the worker,
`mpirun`, a rank) is killed with SIGKILL at a random moment of a running job, so many times.  With the
launcher `slurm` a cluster is started, and the victims are the server, the worker, the program that follows a
job of Slurm, the job of Slurm, which is canceled, and a rank.  A server that is killed is started again
here, a worker by its server.  The figures are printed as JSON.
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
from contextlib import contextmanager, nullcontext
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
from tests import slurm
from tests.api.processes import alive

MARK = "ENSEMBLE_BENCHMARK_FAMILY"
SLURM_JOB = "slurm-job"
VICTIMS = {
    "mpirun": ("server", "worker", "mpirun", "rank"),
    "slurm": ("server", "worker", "follower", SLURM_JOB, "rank"),
}
PATIENCE = 600.0  # a machine may be busy with other things
READERS = 2
AHEAD = 3  # jobs that wait


class Service:
    """`ensemble serve`, started again whenever it is killed, and the cluster that it uses, if any."""

    def __init__(self, store: Path, port: int, cluster: slurm.Cluster | None) -> None:
        self.mark = uuid4().hex
        self._cluster = cluster
        self._environment = os.environ | {MARK: self.mark}
        if cluster is not None:
            self._environment |= cluster.variables | {"ENSEMBLE_LAUNCHER": "slurm"}
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
            self._command, env=self._environment, stdout=self._log, stderr=self._log
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

    def kill(self, victim: str) -> bool:
        """Kill what plays this part at the moment; tell whether there was anything."""
        if victim == SLURM_JOB:
            running = self.cluster_jobs("--states=RUNNING")
            if running and self._cluster is not None:
                self._cluster.run("scancel", *running)
            return bool(running)
        found = self.find(victim)
        if found is not None:
            found.send_signal(signal.SIGKILL)
        return found is not None

    def cluster_jobs(self, *options: str) -> list[str]:
        """Return the numbers of the jobs in the queue of the cluster."""
        return [] if self._cluster is None else self._cluster.jobs(*options)

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
    if part == "follower":
        return "api.worker.watcher" not in command and "api.worker.launchers.slurm_job" in command
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
    wait_for(lambda: service.find("rank"))
    time.sleep(chance.uniform(0, 3.0))
    wait_for(lambda: jobs.latest(1, status=JobStatus.RUNNING) and service.find("rank"))
    (job,) = jobs.latest(1, status=JobStatus.RUNNING) or [None]
    spared = {"server"} if victim in ("server", "worker") else {"server", "worker"}
    old = [process for process in service.members() if not any(_plays(process, part) for part in spared)]
    if job is None or not service.kill(victim):
        return {}
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
    parser.add_argument("--launcher", choices=list(VICTIMS), default="mpirun")
    parser.add_argument("--victims", nargs="+", choices={name for part in VICTIMS.values() for name in part})
    parser.add_argument("--seed", type=int, default=6)
    parser.add_argument("--minutes", type=float, default=600.0, help="after which fewer kills are enough")
    parser.add_argument("--port", type=int, default=8123)
    options = parser.parse_args()
    options.directory.mkdir(parents=True)
    with slurm.running() if options.launcher == "slurm" else nullcontext() as cluster:
        print(json.dumps(figures(options, cluster), indent=2))


def figures(options: argparse.Namespace, cluster: slurm.Cluster | None) -> dict[str, Any]:
    """Kill and count."""
    store = options.directory / "store"
    Store.open(store).close()
    chance = random.Random(options.seed)
    took: dict[str, list[dict[str, float]]] = {
        victim: [] for victim in options.victims or VICTIMS[options.launcher]
    }
    remade = 0
    with queue(store) as jobs:
        service = Service(store, options.port, cluster)
        load = Load(service.address, jobs)
        known: dict[str, str] = {}
        deadline = time.monotonic() + 60 * options.minutes
        while any(len(kills) < options.kills for kills in took.values()) and time.monotonic() < deadline:
            for victim, kills in took.items():
                if kill := kill_once(service, jobs, victim, chance):
                    kills.append(kill)
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
    return {
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
        "jobs left on the cluster": len(service.cluster_jobs()),
        "attempts": sum(job.attempts for job in kept.values()),
        "kills": {victim: summary(kills) for victim, kills in took.items()},
    }


def summary(kills: list[dict[str, float]]) -> dict[str, float]:
    """Summarize how long things took after the kills of one victim."""
    seconds = {what: [kill[what] for kill in kills] for what in kills[0]} if kills else {}
    return (
        {"times": len(kills)}
        | {f"most seconds until {what}": max(each) for what, each in seconds.items()}
        | {f"mean seconds until {what}": fmean(each) for what, each in seconds.items()}
    )


if __name__ == "__main__":
    main()
