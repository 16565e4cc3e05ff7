"""The queue: jobs in a database, from where workers lease them.

Every change is one statement that says which state it is a change of.  So it either happens as a whole or,
where somebody else was first, not at all, whatever the number of processes and whatever the database.
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
from api.jobs.intake import Intake
from api.jobs.job import UNFINISHED, IdempotencyConflict, Job, JobStatus, Lease, TooManyJobs, Work
from api.jobs.job_records import JobRecords
from api.jobs.worker_name import has_died
from ensemble.timestamp import now

LEASE_SECONDS = 3.0
LOGS = "jobs"  # directory in the store

_SEEN = tuple(getattr(JobRow, name) for name in Job.model_fields)


@dataclass(frozen=True)
class Offer:
    """A job on its way to disk; `accepted` has a result as soon as that is decided."""

    job: Job
    idempotency_key: str | None
    fingerprint: str
    most_unfinished: int | None
    accepted: Future[bool]


@dataclass(frozen=True)
class Submitted:
    """A job that is committed to disk, and whether it is new or that of an earlier equal request."""

    job: Job
    new: bool


class Jobs:
    """The jobs of a service, for any number of processes and threads at once.

    `records` are the same jobs as JSON.

    Parameters
    ----------
    database : Database
    store : Path
        Directory of the store, which keeps the jobs' logs, too.
    clock : callable
        The present.  The clocks of hosts that share a queue must agree to within a fraction of
        `LEASE_SECONDS`.
    """

    def __init__(self, database: Database, store: Path, clock: Callable[[], datetime] = now) -> None:
        self.records = JobRecords(database)
        self._database = database
        self._intake = Intake(database)
        self._directory = store / LOGS
        self._clock = clock

    def offer(
        self,
        work: Work,
        owner: str,
        ranks: int,
        seconds: float,
        idempotency_key: str | None = None,
        most_unfinished: int | None = None,
    ) -> Offer:
        """Put a job on its way to disk, and return at once.

        Parameters
        ----------
        work : Work
        owner : str
        ranks : int
        seconds : float
            How long an attempt may take.
        idempotency_key : str, optional
            Of the owner's choice.  However often a request comes with one key, it makes one job.
        most_unfinished : int, optional
            How many unfinished jobs the owner may have, this one included.
        """
        moment = self._clock()
        job = Job(
            id=secrets.token_hex(16),
            owner=owner,
            kind=work.kind,
            name=work.name,
            key=work.key,
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
        fingerprint = _fingerprint(work, ranks, seconds)
        row = dict(job) | {
            "document": work.document,
            "idempotency_key": idempotency_key,
            "fingerprint": fingerprint,
        }
        accepted = self._intake.add(row, most_unfinished)
        return Offer(job, idempotency_key, fingerprint, most_unfinished, accepted)

    def settled(self, offer: Offer) -> Submitted:
        """Wait until a job that was offered is on disk.

        Raises
        ------
        IdempotencyConflict
            If the key came with another request before.
        TooManyJobs
            If the owner has as many as that.  Processes that accept jobs at the same moment do not see each
            other's, so together they may accept a few more.
        """
        if offer.accepted.result():
            return Submitted(offer.job, new=True)
        earlier = self._earlier(offer)
        if earlier is None:
            raise TooManyJobs(
                f"jobs: {offer.most_unfinished} of {offer.job.owner} are not finished, "
                "and there may not be more"
            )
        return Submitted(earlier, new=False)

    def _earlier(self, offer: Offer) -> Job | None:
        """Return the job that an idempotency key has made already."""
        if offer.idempotency_key is None:
            return None
        query = select(*_SEEN, JobRow.fingerprint).where(
            JobRow.owner == offer.job.owner, JobRow.idempotency_key == offer.idempotency_key
        )
        with self._database.connect() as connection:
            row = connection.execute(query).one_or_none()
        if row is None:
            return None
        if row.fingerprint != offer.fingerprint:
            raise IdempotencyConflict(
                f"Idempotency-Key: {offer.idempotency_key} came with another request before; use a new one"
            )
        return Job.model_validate(row)

    def get(self, identifier: str) -> Job:
        """Return a job.

        Raises
        ------
        NoSuchJob
        """
        return Job.model_validate_json(self.records.one(identifier).json)

    def document(self, job: Job) -> dict[str, Any]:
        """Return the study or the scene that a job carries out."""
        with self._database.connect() as connection:
            return connection.execute(select(JobRow.document).where(JobRow.id == job.id)).scalar_one()

    def latest(
        self, limit: int, after: str | None = None, owner: str | None = None, status: JobStatus | None = None
    ) -> list[Job]:
        """Return jobs, the latest first: at most `limit`, from the one that follows `after`.

        Raises
        ------
        NoSuchJob
            If there is no job `after`.
        """
        found = self.records.page(limit, after, owner, status)
        return [Job.model_validate_json(record.json) for record in found]

    def counts(self) -> dict[JobStatus, int]:
        """Say how many jobs there are of each status."""
        query = select(JobRow.status, func.count()).group_by(JobRow.status)
        with self._database.connect() as connection:
            found = {JobStatus(status): count for status, count in connection.execute(query)}
        return {status: found.get(status, 0) for status in JobStatus}

    def dismiss(self, identifier: str) -> Job:
        """Give a job up, and return it; one that is finished stays as it is.

        A worker that runs it ends its processes as soon as it hears of it.

        Raises
        ------
        NoSuchJob
        """
        unfinished = update(JobRow).where(JobRow.id == identifier, JobRow.status.in_(UNFINISHED))
        self._change(self._ended(unfinished, JobStatus.DISMISSED, "dismissed"))
        return self.get(identifier)

    def lease(self, worker: str) -> Lease | None:
        """Take the next job for a worker, named by `api.jobs.worker_name`; None if there is none to be had.

        It is the oldest one of the owner who has the fewest running.  A job whose worker has let its lease
        run out, or is seen to have died, takes part again.
        """
        moment = self._clock()
        running = select(JobRow.worker).where(JobRow.status == JobStatus.RUNNING)
        expires = moment + timedelta(seconds=LEASE_SECONDS)
        take = (
            update(JobRow)
            .where(JobRow.number == _next_number(), JobRow.status == JobStatus.ACCEPTED)
            .values(
                status=JobStatus.RUNNING,
                message="starting",
                attempts=JobRow.attempts + 1,
                worker=worker,
                expires=expires,
                started=func.coalesce(JobRow.started, literal(moment, JobRow.started.type)),
                updated=moment,
            )
            .returning(*_SEEN, JobRow.document)
        )
        with self._database.begin() as connection:
            dead = [name for name in connection.scalars(running) if name is not None and has_died(name)]
            lost = (
                update(JobRow)
                .where(
                    JobRow.status == JobStatus.RUNNING, or_(JobRow.expires < moment, JobRow.worker.in_(dead))
                )
                .values(_waiting("its worker was lost; waiting for another one", moment))
            )
            connection.execute(lost)
            row = connection.execute(take).one_or_none()
        return None if row is None else Lease(Job.model_validate(row), row.document)

    def heartbeat(self, lease: Lease, progress: int, message: str) -> bool:
        """Renew a lease and say how far the job has come; False if the job is no longer this worker's."""
        moment = self._clock()
        return self._change(
            _leased(lease).values(
                progress=case((JobRow.progress < progress, progress), else_=JobRow.progress),
                message=message,
                expires=moment + timedelta(seconds=LEASE_SECONDS),
                updated=moment,
            )
        )

    def finish(self, lease: Lease, status: JobStatus, message: str) -> bool:
        """End a job; False if it is no longer this worker's, which then changes nothing."""
        return self._change(self._ended(_leased(lease), status, message))

    def give_back(self, lease: Lease, message: str) -> bool:
        """Let another worker have the job; False if it is no longer this worker's."""
        return self._change(_leased(lease).values(_waiting(message, self._clock())))

    def log_path(self, job: Job) -> Path:
        """Return the file that holds what the job's processes have said; it may not be there yet."""
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


def _fingerprint(work: Work, ranks: int, seconds: float) -> str:
    request = f"[{json.dumps(work.name)}, {work.text}, {json.dumps(ranks)}, {json.dumps(seconds)}]"
    return hashlib.sha256(request.encode()).hexdigest()


def _next_number() -> ScalarSelect[int]:
    waiting = (
        select(JobRow.owner, func.min(JobRow.number).label("number"))
        .where(JobRow.status == JobStatus.ACCEPTED)
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
