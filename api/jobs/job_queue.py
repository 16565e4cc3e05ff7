"""The queue: jobs in a database, from where workers lease them.

Every change is one statement that names the state which it changes.  So it either happens as a whole or, if
another process was first, not at all, whatever the number of processes and whatever the database.
"""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from sqlalchemy import (
    ScalarSelect,
    Update,
    case,
    func,
    literal,
    or_,
    select,
    update,
)

from api.database.database_tables import JobRow
from api.database.service_database import Database
from api.jobs.group_commit import GroupCommit
from api.jobs.job import UNFINISHED, IdempotencyConflict, Job, JobStatus, Lease, TooManyJobs
from api.jobs.job_records import JobRecords
from api.jobs.worker_identity import has_died
from ensemble.questions import Question
from ensemble.timestamp import now

LEASE_SECONDS = 3.0
LOGS = "jobs"  # directory in the store

_JOB_COLUMNS = tuple(getattr(JobRow, name) for name in Job.model_fields)


@dataclass(frozen=True)
class PendingSubmission:
    """A job on its way to disk.

    Attributes
    ----------
    job : Job
        As it is if it is accepted.
    idempotency_key : str or None
        Of the owner's choice.
    fingerprint : str
        Digest of the request.
    most_unfinished : int or None
        How many unfinished jobs the owner may have.
    accepted : Future
        Its result is whether the job is new and on disk.
    """

    job: Job
    idempotency_key: str | None
    fingerprint: str
    most_unfinished: int | None
    accepted: Future[bool]


@dataclass(frozen=True)
class SubmissionResult:
    """A job that is on disk.

    Attributes
    ----------
    job : Job
        The new one, or that of an earlier request with the same idempotency key.
    new : bool
        Whether it is new.
    """

    job: Job
    new: bool


class Jobs:
    """The jobs of a service, for any number of processes and threads at once.

    Parameters
    ----------
    database : Database
        That has the jobs.
    store : Path
        Directory of the store, which also keeps the jobs' logs.
    clock : callable
        Returns the present.  The clocks of hosts that share a queue must agree to within a fraction of
        `LEASE_SECONDS`.

    Attributes
    ----------
    records : JobRecords
        The same jobs as JSON.
    """

    def __init__(self, database: Database, store: Path, clock: Callable[[], datetime] = now) -> None:
        self.records = JobRecords(database)
        self._database = database
        self._group_commit = GroupCommit(database)
        self._directory = store / LOGS
        self._clock = clock

    def submit(
        self,
        question: Question[Any],
        owner: str,
        ranks: int,
        seconds: float,
        idempotency_key: str | None = None,
        most_unfinished: int | None = None,
    ) -> PendingSubmission:
        """Put a job on its way to disk, and return at once.

        Parameters
        ----------
        question : Question
            What the job answers.
        owner : str
            The user who submits it.
        ranks : int
            How many processes the job uses.
        seconds : float
            How long an attempt may take.
        idempotency_key : str, optional
            Of the owner's choice.  Repeated requests with one key make one job.
        most_unfinished : int, optional
            How many unfinished jobs the owner may have, this one included.

        Returns
        -------
        PendingSubmission
            What `result` takes.
        """
        moment = self._clock()
        job = Job(
            id=secrets.token_hex(16),
            owner=owner,
            kind=question.kind,
            name=question.name,
            key=question.key,
            ranks=ranks,
            seconds=seconds,
            status=JobStatus.ACCEPTED,
            progress=0,
            message="waiting for a worker",
            attempts=0,
            created=moment,
            started=None,
            finished=None,
            updated=moment,
        )
        fingerprint = _fingerprint(question, ranks, seconds)
        row = dict(job) | {
            "document": question.fields,
            "idempotency_key": idempotency_key,
            "fingerprint": fingerprint,
        }
        accepted = self._group_commit.add(row, most_unfinished)
        return PendingSubmission(job, idempotency_key, fingerprint, most_unfinished, accepted)

    def result(self, pending: PendingSubmission) -> SubmissionResult:
        """Wait until a job that was submitted is on disk.

        Parameters
        ----------
        pending : PendingSubmission
            What `submit` has returned.

        Returns
        -------
        SubmissionResult
            The job.

        Raises
        ------
        IdempotencyConflict
            If an earlier request with the same key was another one.
        TooManyJobs
            If the owner has too many unfinished jobs.  Processes that accept jobs at the same moment do not
            see each other's, so together they may accept a few more.
        """
        if pending.accepted.result():
            return SubmissionResult(pending.job, new=True)
        earlier = self._earlier(pending)
        if earlier is None:
            raise TooManyJobs(
                f"jobs: {pending.most_unfinished} of {pending.job.owner} are not finished, "
                "and there may not be more"
            )
        return SubmissionResult(earlier, new=False)

    def _earlier(self, pending: PendingSubmission) -> Job | None:
        """Return the job that an idempotency key has made already."""
        if pending.idempotency_key is None:
            return None
        query = select(*_JOB_COLUMNS, JobRow.fingerprint).where(
            JobRow.owner == pending.job.owner, JobRow.idempotency_key == pending.idempotency_key
        )
        with self._database.connect() as connection:
            row = connection.execute(query).one_or_none()
        if row is None:
            return None
        if row.fingerprint != pending.fingerprint:
            raise IdempotencyConflict(
                f"Idempotency-Key: {pending.idempotency_key} has been used for another request; use a new one"
            )
        return Job.model_validate(row)

    def get(self, identifier: str) -> Job:
        """Return a job.

        Parameters
        ----------
        identifier : str
            Of the job.

        Returns
        -------
        Job
            As it is now.

        Raises
        ------
        NoSuchJob
            If there is none.
        """
        return Job.model_validate_json(self.records.one(identifier).json)

    def document(self, job: Job) -> dict[str, Any]:
        """Return the document of the question that a job answers.

        Parameters
        ----------
        job : Job
            The job.

        Returns
        -------
        dict
            In full.
        """
        with self._database.connect() as connection:
            return connection.execute(select(JobRow.document).where(JobRow.id == job.id)).scalar_one()

    def latest(
        self, limit: int, after: str | None = None, owner: str | None = None, status: JobStatus | None = None
    ) -> list[Job]:
        """Return jobs, the latest first.

        Parameters
        ----------
        limit : int
            How many at most.
        after : str, optional
            Identifier of the job before the first; by default the latest is the first.
        owner : str, optional
            Whose jobs.
        status : JobStatus, optional
            Which status they have.

        Returns
        -------
        list of Job
            As they are now.

        Raises
        ------
        NoSuchJob
            If there is no job `after`.
        """
        records = self.records.page(limit, after, owner, status)
        return [Job.model_validate_json(record.json) for record in records]

    def counts(self) -> dict[JobStatus, int]:
        """Return how many jobs there are of each status."""
        query = select(JobRow.status, func.count()).group_by(JobRow.status)
        with self._database.connect() as connection:
            counts = {JobStatus(status): count for status, count in connection.execute(query)}
        return {status: counts.get(status, 0) for status in JobStatus}

    def dismiss(self, identifier: str) -> Job:
        """Dismiss a job; one that is finished stays as it is.

        A worker that runs it ends its processes at its next heartbeat.

        Parameters
        ----------
        identifier : str
            Of the job.

        Returns
        -------
        Job
            As it is now.

        Raises
        ------
        NoSuchJob
            If there is none.
        """
        unfinished = update(JobRow).where(JobRow.id == identifier, JobRow.status.in_(UNFINISHED))
        self._change(self._ended(unfinished, JobStatus.DISMISSED, "canceled"))
        return self.get(identifier)

    def lease(self, worker: str) -> Lease | None:
        """Lease the next job to a worker.

        It is the oldest job of the owner who has the fewest running, among those that may be tried now.
        A job whose worker has let its lease run out, or is known to have died, is available again; that
        counts as a crash, because a job may take its worker along.

        Parameters
        ----------
        worker : str
            As `api.jobs.worker_identity` identifies it.

        Returns
        -------
        Lease or None
            None if no job is waiting.
        """
        moment = self._clock()
        running = select(JobRow.worker).where(JobRow.status == JobStatus.RUNNING)
        expires = moment + timedelta(seconds=LEASE_SECONDS)
        take = (
            update(JobRow)
            .where(JobRow.number == _next_number(moment), JobRow.status == JobStatus.ACCEPTED)
            .values(
                status=JobStatus.RUNNING,
                message="starting",
                attempts=JobRow.attempts + 1,
                worker=worker,
                expires=expires,
                started=func.coalesce(JobRow.started, literal(moment, JobRow.started.type)),
                updated=moment,
            )
            .returning(*_JOB_COLUMNS, JobRow.document, JobRow.reached, JobRow.crashes)
        )
        with self._database.begin() as connection:
            dead = [name for name in connection.scalars(running) if name is not None and has_died(name)]
            lost = (
                update(JobRow)
                .where(
                    JobRow.status == JobStatus.RUNNING, or_(JobRow.expires < moment, JobRow.worker.in_(dead))
                )
                .values(_waiting("its worker was lost; waiting for another one", moment))
                .values(crashes=JobRow.crashes + 1)
            )
            connection.execute(lost)
            row = connection.execute(take).one_or_none()
        if row is None:
            return None
        return Lease(Job.model_validate(row), row.document, row.reached, row.crashes)

    def heartbeat(self, lease: Lease, progress: int, message: str) -> bool:
        """Renew a lease and record how far the job has come.

        Parameters
        ----------
        lease : Lease
            Of this worker.
        progress : int
            From 0 to 100.
        message : str
            The same for people.

        Returns
        -------
        bool
            False if the job is no longer this worker's.
        """
        moment = self._clock()
        return self._change(
            _leased(lease).values(
                progress=case((JobRow.progress < progress, progress), else_=JobRow.progress),
                message=message,
                reached=lease.reached,
                crashes=lease.crashes,
                expires=moment + timedelta(seconds=LEASE_SECONDS),
                updated=moment,
            )
        )

    def finish(self, lease: Lease, status: JobStatus, message: str) -> bool:
        """Record how a job has ended.

        Parameters
        ----------
        lease : Lease
            Of this worker.
        status : JobStatus
            Succeeded or failed.
        message : str
            Explains the status.

        Returns
        -------
        bool
            False if the job is no longer this worker's; then nothing is changed.
        """
        return self._change(self._ended(_leased(lease), status, message))

    def give_back(self, lease: Lease, message: str, seconds: float = 0.0) -> bool:
        """Make a job available to other workers again.

        Parameters
        ----------
        lease : Lease
            Of this worker.
        message : str
            Says why.
        seconds : float
            How long it waits before it is tried again.  Meanwhile other jobs of its owner have their turn.

        Returns
        -------
        bool
            False if the job is no longer this worker's; then nothing is changed.
        """
        moment = self._clock()
        retry = moment + timedelta(seconds=seconds) if seconds else None
        return self._change(
            _leased(lease)
            .values(_waiting(message, moment))
            .values(retry=retry, reached=lease.reached, crashes=lease.crashes)
        )

    def log_path(self, job: Job) -> Path:
        """Return the file of what a job's processes have written to standard error.

        Parameters
        ----------
        job : Job
            The job.

        Returns
        -------
        Path
            The file may not exist yet.
        """
        return self._directory / f"{job.id}.log"

    def _ended(self, whose: Update, status: JobStatus, message: str) -> Update:
        moment = self._clock()
        ended = whose.values(
            status=status, message=message, worker=None, expires=None, finished=moment, updated=moment
        )
        return ended.values(progress=100) if status is JobStatus.SUCCEEDED else ended

    def _change(self, statement: Update) -> bool:
        with self._database.begin() as connection:
            return connection.execute(statement).rowcount == 1


def _fingerprint(question: Question[Any], ranks: int, seconds: float) -> str:
    request = f"[{json.dumps(question.name)}, {question.text}, {json.dumps(ranks)}, {json.dumps(seconds)}]"
    return hashlib.sha256(request.encode()).hexdigest()


def _next_number(moment: datetime) -> ScalarSelect[int]:
    waiting = (
        select(JobRow.owner, func.min(JobRow.number).label("number"))
        .where(JobRow.status == JobStatus.ACCEPTED, or_(JobRow.retry.is_(None), JobRow.retry <= moment))
        .group_by(JobRow.owner)
        .subquery()
    )
    running = (
        select(JobRow.owner, func.count().label("jobs"))
        .where(JobRow.status == JobStatus.RUNNING)
        .group_by(JobRow.owner)
        .subquery()
    )
    return (
        select(waiting.c.number)
        .outerjoin(running, running.c.owner == waiting.c.owner)
        .order_by(func.coalesce(running.c.jobs, 0), waiting.c.number)
        .limit(1)
        .scalar_subquery()
    )


def _waiting(message: str, moment: datetime) -> dict[str, Any]:
    return {
        "status": JobStatus.ACCEPTED,
        "message": message,
        "worker": None,
        "expires": None,
        "updated": moment,
    }


def _leased(lease: Lease) -> Update:
    """Change a job only while this very lease holds: the attempt is the fencing token."""
    return update(JobRow).where(
        JobRow.id == lease.job.id,
        JobRow.status == JobStatus.RUNNING,
        JobRow.attempts == lease.job.attempts,
    )
