"""The worker: leases one job after the other and has `mpirun` carry it out."""

from __future__ import annotations

import json
import logging
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from api.jobs.job import JobStatus, Kind, Lease
from api.jobs.job_queue import Jobs
from api.jobs.worker_name import own_name
from api.worker.mpirun import Process, mpirun_command

POLL_SECONDS = 0.5
HEARTBEAT_SECONDS = 0.5
MAXIMUM_ATTEMPTS = 100

# Statuses with which the command line ends by itself: done, not every answer found, refused.
_OWN_STATUSES = (0, 1, 2)
_COMMANDS = {Kind.STUDY: "bisect", Kind.SCENE: "run"}

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class JobResult:
    """How a job has ended."""

    status: JobStatus
    message: str


class Worker:
    """Carries out jobs, one at a time and at low priority, until it is told to stop.

    Parameters
    ----------
    jobs : Jobs
    store : Path
        Where runs and boundaries go.
    """

    def __init__(self, jobs: Jobs, store: Path) -> None:
        self._jobs = jobs
        self._store = store
        self._name = own_name()

    def run(self, stop: threading.Event) -> None:
        """Work until `stop` is set; a job that is not finished by then is given back."""
        while not stop.is_set():
            lease = self._jobs.lease(self._name)
            if lease is None:
                stop.wait(POLL_SECONDS)
            else:
                self._carry_out(lease, stop)

    def _carry_out(self, lease: Lease, stop: threading.Event) -> None:
        job = lease.job
        if job.attempts > MAXIMUM_ATTEMPTS:
            self._end(lease, JobResult(JobStatus.FAILED, f"given up: cut short {MAXIMUM_ATTEMPTS} times"))
            return
        log.info("job %s: attempt %d", job.id, job.attempts)
        deadline = time.monotonic() + job.seconds
        with Process(mpirun_command(job.ranks, self._arguments(lease)), self._jobs.log_path(job)) as process:
            while (status := process.wait(HEARTBEAT_SECONDS)) is None:
                if stop.is_set():
                    process.end()
                    self._jobs.give_back(lease, "its worker was stopped; waiting for another one")
                    return
                if time.monotonic() > deadline:
                    process.end()
                    self._end(
                        lease, JobResult(JobStatus.FAILED, f"stopped at its time limit, {job.seconds:g} s")
                    )
                    return
                progress = process.progress
                if not self._jobs.heartbeat(lease, int(100 * progress.fraction), progress.message):
                    log.info("job %s: no longer this worker's", job.id)
                    return
            if status in _OWN_STATUSES:
                self._end(lease, job_result(job.kind, status, process.output(), process.last_words))
            else:
                log.warning("job %s: cut short with status %d", job.id, status)
                self._jobs.give_back(lease, "its processes were killed; waiting for another attempt")

    def _arguments(self, lease: Lease) -> list[str]:
        file = self._jobs.log_path(lease.job).with_suffix(".toml")
        file.parent.mkdir(exist_ok=True)
        file.write_bytes(tomli_w.dumps(lease.document).encode())
        return [
            *(_COMMANDS[lease.job.kind], str(file)),
            *("--store", str(self._store)),
            *("--progress", "json", "--json"),
        ]

    def _end(self, lease: Lease, job_result: JobResult) -> None:
        if self._jobs.finish(lease, job_result.status, job_result.message):
            log.info("job %s: %s, %s", lease.job.id, job_result.status, job_result.message)


def job_result(kind: Kind, status: int, output: str, last_words: str) -> JobResult:
    """Say how a job has ended from what the command line did.

    Parameters
    ----------
    kind : Kind
    status : int
        Its exit status.
    output : str
        One JSON document, unless it ended with an error.
    last_words : str
        The last that it said on standard error.
    """
    try:
        document = json.loads(output)
    except json.JSONDecodeError:
        return JobResult(JobStatus.FAILED, last_words or f"ended with status {status}")
    message = _study_message(document) if kind is Kind.STUDY else document["failure"] or document["outcome"]
    return JobResult(JobStatus.SUCCEEDED if status == 0 else JobStatus.FAILED, message)


def _study_message(document: Mapping[str, Any]) -> str:
    points = document["boundary"]
    open_points = [point for point in points if point["status"] != "converged"]
    return f"{len(points) - len(open_points)} of {len(points)} points converged" + "".join(
        f"; {name} {value:g}: {point['status']}"
        for point in open_points
        for name, value in point["parameters"].items()
    )
