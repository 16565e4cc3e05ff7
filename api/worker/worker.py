"""The worker: leases one job after the other and has `mpirun` carry it out."""

from __future__ import annotations

import json
import logging
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import tomli_w

from api.jobs.job import JobStatus, Lease
from api.jobs.job_queue import Jobs
from api.jobs.worker_identity import own_identity
from api.worker.mpirun import Process, mpirun_command
from ensemble.questions import kind_named

POLL_SECONDS = 0.5
HEARTBEAT_SECONDS = 0.5
MAXIMUM_ATTEMPTS = 100

# Exit statuses with which a command ends by itself: complete, incomplete, refused.
_OWN_STATUSES = (0, 1, 2)

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class JobResult:
    """How a job has ended.

    Attributes
    ----------
    status : JobStatus
        Succeeded or failed.
    message : str
        Explains the status.
    """

    status: JobStatus
    message: str


class Worker:
    """Carries out jobs, one at a time and at low priority, until it is stopped.

    Parameters
    ----------
    jobs : Jobs
        The queue.
    store : Path
        Directory of the store that keeps runs and answers.
    """

    def __init__(self, jobs: Jobs, store: Path) -> None:
        self._jobs = jobs
        self._store = store
        self._identity = own_identity()

    def run(self, stop: threading.Event) -> None:
        """Work until an event is set; a job that is not finished by then is given back.

        Parameters
        ----------
        stop : threading.Event
            Set to stop.
        """
        while not stop.is_set():
            lease = self._jobs.lease(self._identity)
            if lease is None:
                stop.wait(POLL_SECONDS)
            else:
                self._carry_out(lease, stop)

    def _carry_out(self, lease: Lease, stop: threading.Event) -> None:
        job = lease.job
        if job.attempts > MAXIMUM_ATTEMPTS:
            self._finish(lease, JobResult(JobStatus.FAILED, f"given up: cut short {MAXIMUM_ATTEMPTS} times"))
            return
        log.info("job %s: attempt %d", job.id, job.attempts)
        with Process(mpirun_command(job.ranks, self._arguments(lease)), self._jobs.log_path(job)) as process:
            status = self._wait(process, lease, stop)
            if status is None:
                return
            if status in _OWN_STATUSES:
                self._finish(lease, job_result(job.kind, status, process.output(), process.last_message))
            else:
                log.warning("job %s: cut short with status %d", job.id, status)
                self._jobs.give_back(lease, "its processes were killed; waiting for another attempt")

    def _wait(self, process: Process, lease: Lease, stop: threading.Event) -> int | None:
        """Wait for the end of an attempt and return its exit status; None if it has to be ended before."""
        job = lease.job
        deadline = time.monotonic() + job.seconds
        while (status := process.wait(HEARTBEAT_SECONDS)) is None:
            if stop.is_set():
                process.end()
                self._jobs.give_back(lease, "its worker was stopped; waiting for another one")
                return None
            if time.monotonic() > deadline:
                process.end()
                message = f"stopped at its time limit, {job.seconds:g} s"
                self._finish(lease, JobResult(JobStatus.FAILED, message))
                return None
            progress = process.progress
            if not self._jobs.heartbeat(lease, int(100 * progress.fraction), progress.message):
                log.info("job %s: no longer this worker's", job.id)
                return None
        return status

    def _arguments(self, lease: Lease) -> list[str]:
        file = self._jobs.log_path(lease.job).with_suffix(".toml")
        file.parent.mkdir(exist_ok=True)
        file.write_bytes(tomli_w.dumps(lease.document).encode())
        return [
            *(kind_named(lease.job.kind).command, str(file)),
            *("--store", str(self._store)),
            *("--progress", "json", "--json"),
        ]

    def _finish(self, lease: Lease, result: JobResult) -> None:
        if self._jobs.finish(lease, result.status, result.message):
            log.info("job %s: %s, %s", lease.job.id, result.status, result.message)


def job_result(kind: str, status: int, output: str, last_message: str) -> JobResult:
    """Return how a job has ended, from what its command has done.

    Parameters
    ----------
    kind : str
        Which kind of question the job answers.
    status : int
        Exit status of the command.
    output : str
        Standard output: one JSON document, unless the command ended with an error.
    last_message : str
        Last line of standard error.

    Returns
    -------
    JobResult
    """
    try:
        document = json.loads(output)
    except json.JSONDecodeError:
        return JobResult(JobStatus.FAILED, last_message or f"ended with status {status}")
    succeeded = JobStatus.SUCCEEDED if status == 0 else JobStatus.FAILED
    return JobResult(succeeded, kind_named(kind).summary(document))
