"""The worker: leases one job after the other and has a launcher carry it out.

Only what a command prints as its answer, with the status of an answer, decides a job.  Every other end is
trouble, and the job is tried again: its processes were killed, or the disk, the database or the memory failed
them.  What is in the store is not run again, and runs in progress go on from their checkpoints.
"""

from __future__ import annotations

import json
import logging
import math
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Concatenate, ParamSpec

import tomli_w

from api.jobs.job import Job, JobStatus, Lease
from api.jobs.job_queue import Jobs
from api.jobs.worker_identity import own_identity
from api.worker.delays import growing_delay
from api.worker.job_log import JobLog
from api.worker.job_process import Process
from api.worker.launchers.launcher import TIME_LIMIT_STATUS, JobAttempt, Launcher
from ensemble.errors import SUSPENDED_STATUS
from ensemble.questions import INCOMPLETE_STATUS, kind_named
from ensemble.store import Store
from ensemble.store.sql_database import UNUSABLE, reason

POLL_SECONDS = 0.5
HEARTBEAT_SECONDS = 0.5
SUSPENSION_SECONDS = 6.0  # for a job to keep its runs when its worker is stopped
MAXIMUM_CRASHES = 8  # of a job at the same point
LONGEST_DELAY = 128.0  # before a job is tried again, in seconds
LONGEST_WAIT = 10.0  # before the database or the disk is tried again, in seconds

# Exit statuses with which a command answers, and what becomes of the job.
ANSWERS: Mapping[int, JobStatus] = {0: JobStatus.SUCCEEDED, INCOMPLETE_STATUS: JobStatus.FAILED}
TROUBLE = (*UNUSABLE, OSError)
_SUSPENDED = "asked to end; goes on from its checkpoints"

Arguments = ParamSpec("Arguments")

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
    store : Store
        It keeps runs and answers.
    memory : int
        Bytes that the processes of a job may use together.
    launcher : Launcher
        Starts the ranks of a job.
    """

    def __init__(self, jobs: Jobs, store: Store, memory: int, launcher: Launcher) -> None:
        self._jobs = jobs
        self._store = store
        self._memory = memory
        self._launcher = launcher
        self._identity = own_identity()
        self._has_seen_outage = False  # during the present attempt
        self._futile: Counter[str] = Counter()  # attempts here since a job last came further, by its id

    def run(self, stop: threading.Event) -> None:
        """Work until an event is set; a job that is not finished by then is given back.

        While the store or the database cannot be used no job is leased.

        Parameters
        ----------
        stop : threading.Event
            Set to stop.
        """
        tries = 0
        while not stop.is_set():
            try:
                self._store.require_usable()
                lease = self._jobs.lease(self._identity)
            except TROUBLE as error:
                tries += 1
                log.warning("waiting: the store or the database cannot be used (%s)", reason(error))
                stop.wait(growing_delay(tries, LONGEST_WAIT))
                continue
            tries = 0
            if lease is None:
                stop.wait(POLL_SECONDS)
            elif lease.crashes >= MAXIMUM_CRASHES:  # the last one took its worker along
                self._give_up(lease, stop)
            else:
                self._carry_out(lease, stop)

    def _carry_out(self, lease: Lease, stop: threading.Event) -> None:
        job = lease.job
        log.info("job %s: attempt %d", job.id, job.attempts)
        self._has_seen_outage = False
        try:
            attempt = self._attempt(lease)
            command = self._launcher.command(attempt)
        except OSError as error:
            self._futile[job.id] += 1
            self._try_again_later(lease, stop, f"could not be started ({error.strerror})")
            return
        self._log(lease).add(f"attempt {job.attempts}, ranks: {job.ranks}")
        with Process(command, self._log(lease)) as process:
            status = self._wait(process, lease, stop)
            if status is None:
                process.end()
                self._launcher.end(attempt)
                return
            if status == TIME_LIMIT_STATUS and self._launcher.limits_time:
                self._finish(lease, stop, _at_time_limit(job))
                return
            result = job_result(job.kind, status, process.output())
            if result is not None:
                self._finish(lease, stop, result)
                return
        reached = lease.at(process.progress.reached)
        self._futile[job.id] = self._futile[job.id] + 1 if reached is lease else 0
        if status == SUSPENDED_STATUS:
            waits = self._futile[job.id] > 0 and not stop.is_set()
            seconds = self._delay(reached) if waits else 0.0
            self._record(stop, self._jobs.give_back, reached, _SUSPENDED, seconds)
            return
        self._launcher.end(attempt)  # its command may have been killed alone
        self._try_again_later(reached, stop, f"ended {_in_words(status)}")

    def _wait(self, process: Process, lease: Lease, stop: threading.Event) -> int | None:
        """Wait for the end of an attempt and return its exit status; None if it has to be ended before."""
        job = lease.job
        deadline = math.inf if self._launcher.limits_time else time.monotonic() + job.seconds
        while (status := process.wait(HEARTBEAT_SECONDS)) is None:
            if stop.is_set():
                process.suspend(SUSPENSION_SECONDS)
                message = "its worker was stopped; waiting for another one"
                self._record(stop, self._jobs.give_back, lease.at(process.progress.reached), message)
                return None
            if time.monotonic() > deadline:
                process.end()
                self._finish(lease, stop, _at_time_limit(job))
                return None
            if not self._is_still_ours(lease, process):
                log.info("job %s: no longer this worker's", job.id)
                return None
            self._look_for_outage(job)
        return status

    def _look_for_outage(self, job: Job) -> None:
        """Note whether the store or its catalog cannot be used now."""
        try:
            self._store.require_usable()
        except TROUBLE as error:
            if not self._has_seen_outage:
                log.warning("job %s: the store cannot be used (%s)", job.id, reason(error))
            self._has_seen_outage = True

    def _is_still_ours(self, lease: Lease, process: Process) -> bool:
        """Renew a lease.  While the database is away nobody else can take the job, so it goes on."""
        progress = process.progress
        lease = lease.at(progress.reached)
        try:
            return self._jobs.heartbeat(lease, int(100 * progress.fraction), progress.message)
        except TROUBLE as error:
            log.warning("job %s: goes on without the database (%s)", lease.job.id, reason(error))
            self._has_seen_outage = True
            return True

    def _try_again_later(self, lease: Lease, stop: threading.Event, what: str) -> None:
        """Give a job back whose attempt has ended without an answer, or give it up."""
        number = lease.job.attempts
        self._look_for_outage(lease.job)
        if self._has_seen_outage:  # which may have ended the attempt, and says nothing of the job
            what += " in an outage"
        else:
            lease = lease.crashed()
        if lease.crashes >= MAXIMUM_CRASHES:
            self._log(lease).add(f"attempt {number} {what}; given up")
            self._give_up(lease, stop)
            return
        seconds = self._delay(lease)
        message = f"attempt {number} {what}; tried again after {seconds:.1f} s"
        log.warning("job %s: %s", lease.job.id, message)
        self._log(lease).add(message)
        self._record(stop, self._jobs.give_back, lease, message, seconds)

    def _delay(self, lease: Lease) -> float:
        """Return how long a job waits that may never come further, whatever has ended its attempts."""
        return growing_delay(max(self._futile[lease.job.id], lease.crashes, 1), LONGEST_DELAY)

    def _give_up(self, lease: Lease, stop: threading.Event) -> None:
        message = f"given up: {lease.crashes} attempts ended at the same point: {self._log(lease).end()}"
        self._finish(lease, stop, JobResult(JobStatus.FAILED, message))

    def _attempt(self, lease: Lease) -> JobAttempt:
        job, log_path = lease.job, self._jobs.log_path(lease.job)
        file = log_path.with_suffix(".toml")
        file.parent.mkdir(exist_ok=True)
        file.write_bytes(tomli_w.dumps(lease.document).encode())
        arguments = [
            *(kind_named(job.kind).command, str(file)),
            *("--store", str(self._store.path)),
            *("--progress", "json", "--json"),
        ]
        return JobAttempt(job.id, job.ranks, self._memory // job.ranks, job.seconds, arguments, log_path)

    def _log(self, lease: Lease) -> JobLog:
        return JobLog(self._jobs.log_path(lease.job))

    def _finish(self, lease: Lease, stop: threading.Event, result: JobResult) -> None:
        del self._futile[lease.job.id]
        self._log(lease).add(f"{result.status}: {result.message}")
        if self._record(stop, self._jobs.finish, lease, result.status, result.message):
            log.info("job %s: %s, %s", lease.job.id, result.status, result.message)

    def _record(
        self,
        stop: threading.Event,
        change: Callable[Concatenate[Lease, Arguments], bool],
        lease: Lease,
        *arguments: Arguments.args,
        **named: Arguments.kwargs,
    ) -> bool:
        """Change a job, again and again while the database is away; if the worker stops, the lease ends."""
        tries = 0
        while True:
            try:
                return change(lease, *arguments, **named)
            except TROUBLE as error:
                tries += 1
                log.warning("job %s: the database cannot be used (%s)", lease.job.id, reason(error))
            if stop.wait(growing_delay(tries, LONGEST_WAIT)):
                return False


def job_result(kind: str, status: int, output: str) -> JobResult | None:
    """Return how a job has ended, from what its command has done.

    Parameters
    ----------
    kind : str
        Which kind of question the job answers.
    status : int
        Exit status of the command.
    output : str
        Standard output: one JSON document if the command has answered.

    Returns
    -------
    JobResult or None
        None if there is no answer.
    """
    if status not in ANSWERS:
        return None
    try:
        return JobResult(ANSWERS[status], kind_named(kind).summary(json.loads(output)))
    except (ValueError, LookupError, TypeError):  # cut short, or not the document of such an answer
        return None


def _at_time_limit(job: Job) -> JobResult:
    return JobResult(JobStatus.FAILED, f"stopped at its time limit, {job.seconds:g} s")


def _in_words(status: int) -> str:
    try:
        return f"by {signal.Signals(status - 128).name}"
    except ValueError:
        return f"with status {status}"
