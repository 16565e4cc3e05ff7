"""Jobs: submit, list, watch and dismiss them."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from http import HTTPStatus
from pathlib import Path as FilePath
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Path, Query, Request, Response
from fastapi.responses import PlainTextResponse
from fastapi.sse import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool

from api.auth import TokenScope
from api.http.caching import json_response
from api.http.openapi import reference
from api.http.paging import CollectionPage, Limit, page_response
from api.http.problems import OUTAGES, Problem, documented, unavailable
from api.jobs.job import Job, JobStatus, NoSuchJob, TooManyJobs
from api.jobs.submissions import CheckedSubmission, Estimate, Submission, most_ranks, usual_ranks
from api.routes.service import Reader, Service, Submitter
from api.settings import Settings
from ensemble.errors import BadInput
from ensemble.store import Record
from ensemble.store.sql_database import reason

router = APIRouter(tags=["jobs"])

_log = logging.getLogger("uvicorn.error")

JobKey = Annotated[str, Path(pattern="^[0-9a-z-]{1,64}$", description="Identifier of the job.")]
LOG_BYTES = 1 << 20  # largest part of a log that is sent
ACCEPT_SECONDS = 20.0  # for a job to be on disk
SUBMISSION_BODY = {
    "requestBody": {"required": True, "content": {"application/json": {"schema": reference(Submission)}}}
}
UNSUPPORTED_MEDIA_TYPE = documented(HTTPStatus.UNSUPPORTED_MEDIA_TYPE)
NO_SUCH_JOB = documented(HTTPStatus.NOT_FOUND)


async def read_json_body(request: Request) -> bytes:
    """Return the body of a request whose content type is JSON.

    Parameters
    ----------
    request : Request

    Returns
    -------
    bytes

    Raises
    ------
    Problem
        If the request has another content type.
    """
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if media_type != "application/json":
        raise Problem(
            HTTPStatus.UNSUPPORTED_MEDIA_TYPE, f"Content-Type: {media_type!r} — must be application/json"
        )
    return await request.body()


JsonBody = Annotated[bytes, Depends(read_json_body)]


@router.post("/estimate", openapi_extra=SUBMISSION_BODY, responses=UNSUPPORTED_MEDIA_TYPE)
async def estimate_cost(reader: Reader, body: JsonBody) -> Estimate:
    """Give an upper bound of the cost of a job, and the time that it is likely to take, without making it.

    Parameters
    ----------
    reader : Caller
    body : bytes
        JSON of a `Submission`.

    Returns
    -------
    Estimate

    Raises
    ------
    BadInput
        If a field is invalid; the message names it.
    """
    service = reader.service
    checked = await service.submissions.read(body)
    ranks = checked.submission.ranks or usual_ranks(checked.question, checked.estimate, service.settings)
    return await run_in_threadpool(service.expected_times.added, checked.estimate, checked.question, ranks)


@router.post(
    "/jobs",
    status_code=HTTPStatus.ACCEPTED,
    response_model=Job,
    openapi_extra=SUBMISSION_BODY,
    responses=UNSUPPORTED_MEDIA_TYPE,
)
async def submit_job(
    submitter: Submitter,
    body: JsonBody,
    idempotency_key: Annotated[
        str | None,
        Header(
            min_length=1,
            max_length=200,
            description="A key of the client's choice. Repeated requests with one key make one job.",
        ),
    ] = None,
) -> Response:
    """Accept a job. It is on disk when this is answered.

    Parameters
    ----------
    submitter : Caller
    body : bytes
        JSON of a `Submission`.
    idempotency_key : str or None

    Returns
    -------
    Response

    Raises
    ------
    BadInput
        If a field is invalid; the message names it.
    Problem
        If the job is too large, or its owner has too many unfinished jobs or submits too often.
    """
    service = submitter.service
    checked = await service.submissions.read(body)
    ranks, seconds = _resources(service.settings, checked)
    await service.limits.count_submission(submitter.user)
    pending = service.jobs.submit(
        checked.question, submitter.user, ranks, seconds, idempotency_key, service.settings.maximum_jobs
    )
    # Awaited through `wait`: if the client disconnects, the transaction, which other jobs share, goes on.
    accepted = asyncio.wrap_future(pending.accepted)
    await asyncio.wait([accepted], timeout=ACCEPT_SECONDS)
    if not accepted.done():
        raise unavailable("the database does not answer; repeat the request with its Idempotency-Key")
    accepted.result()
    try:
        result = await service.look_up(service.jobs.result, pending)
    except TooManyJobs as error:
        raise Problem(HTTPStatus.TOO_MANY_REQUESTS, str(error)) from error
    response = json_response(result.job)
    response.status_code = HTTPStatus.ACCEPTED
    # Relative to the address of the request, for proxies that add a prefix.
    response.headers["Location"] = f"jobs/{result.job.id}"
    return response


def _resources(settings: Settings, checked: CheckedSubmission) -> tuple[int, float]:
    """Return the number of ranks of a job and the time limit of an attempt, in seconds."""
    cost = checked.estimate
    if cost.recorded > cost.most_recorded:
        raise Problem(
            HTTPStatus.UNPROCESSABLE_ENTITY,
            f"output: {cost.recorded:.3g} numbers — must be at most {cost.most_recorded:.3g}, over all runs; "
            "raise output.interval or output.frame_interval",
            recorded=cost.recorded,
            most_recorded=cost.most_recorded,
        )
    if cost.memory > cost.most_memory:
        raise Problem(
            HTTPStatus.UNPROCESSABLE_ENTITY,
            f"memory: {cost.memory:.3g} bytes — must be at most {cost.most_memory:.3g}; "
            "a viscosity contrast needs the square of points × vesicles",
            memory=cost.memory,
            most_memory=cost.most_memory,
        )
    if not cost.accepted:
        raise Problem(
            HTTPStatus.UNPROCESSABLE_ENTITY,
            f"cost: {cost.cost:.3g} — must be at most {cost.maximum:.3g} "
            "(points × vesicles × time to simulate, over all runs)",
            cost=cost.cost,
            maximum=cost.maximum,
        )
    most = most_ranks(cost, settings)
    ranks = checked.submission.ranks or usual_ranks(checked.question, cost, settings)
    seconds = checked.submission.seconds or settings.maximum_seconds
    if ranks > settings.maximum_ranks:
        raise BadInput(f"ranks: {ranks} — must be at most {settings.maximum_ranks}")
    if ranks > most:
        raise BadInput(
            f"ranks: {ranks} — must be at most {most}: each needs {cost.memory:.3g} bytes of the "
            f"{cost.most_memory:.3g} that a job may use"
        )
    if seconds > settings.maximum_seconds:
        raise BadInput(f"seconds: {seconds:g} — must be at most {settings.maximum_seconds:g}")
    return ranks, seconds


@router.get("/jobs", response_model=CollectionPage[Job])
async def list_jobs(
    request: Request,
    reader: Reader,
    owner: Annotated[str | None, Query(max_length=64)] = None,
    status: JobStatus | None = None,
    after: Annotated[
        str | None,
        Query(pattern="^[0-9a-z-]{1,64}$", description="Identifier of the last job of the previous page."),
    ] = None,
    limit: Limit = 100,
) -> Response:
    """List the jobs, the latest first.

    Parameters
    ----------
    request : Request
    reader : Caller
    owner : str or None
        Only jobs of this user.
    status : JobStatus or None
        Only jobs of this status.
    after : str or None
        Identifier of the last job of the previous page.
    limit : int
        Largest number of jobs.

    Returns
    -------
    Response

    Raises
    ------
    BadInput
        If there is no job `after`.
    """
    service = reader.service
    try:
        records = await service.look_up(service.jobs.records.page, limit + 1, after, owner, status)
    except NoSuchJob:
        raise BadInput(f"after: there is no job {after}") from None
    return page_response(request, records, limit)


@router.get("/jobs/{identifier}", response_model=Job, responses=NO_SUCH_JOB)
async def get_job(reader: Reader, identifier: JobKey) -> Response:
    """Give a job with its status and progress.

    Parameters
    ----------
    reader : Caller
    identifier : str

    Returns
    -------
    Response

    Raises
    ------
    NoSuchJob
        If there is no such job.
    """
    record = await reader.service.look_up(reader.service.jobs.records.one, identifier)
    return json_response(record.json)


@router.get("/jobs/{identifier}/submission", responses=NO_SUCH_JOB)
def get_submission(reader: Reader, identifier: JobKey) -> dict[str, Any]:
    """Give the document that makes the same job when it is submitted.

    Parameters
    ----------
    reader : Caller
    identifier : str

    Returns
    -------
    dict
        JSON of a `Submission`.

    Raises
    ------
    NoSuchJob
        If there is no such job.
    """
    jobs = reader.service.jobs
    job = jobs.get(identifier)
    return {job.kind: jobs.document(job), "ranks": job.ranks, "seconds": job.seconds}


@router.delete("/jobs/{identifier}", responses=NO_SUCH_JOB)
def dismiss_job(submitter: Submitter, identifier: JobKey) -> Job:
    """Dismiss a job: its processes end within seconds. A finished job stays as it is.

    Parameters
    ----------
    submitter : Caller
    identifier : str

    Returns
    -------
    Job

    Raises
    ------
    NoSuchJob
        If there is no such job.
    Problem
        If the caller is neither the owner nor an administrator.
    """
    owner = submitter.service.jobs.get(identifier).owner
    if submitter.user != owner and not submitter.scope.includes(TokenScope.ADMIN):
        raise Problem(HTTPStatus.FORBIDDEN, "Authorization: only its owner or an admin may dismiss a job")
    return submitter.service.jobs.dismiss(identifier)


async def open_stream(reader: Reader, identifier: JobKey) -> AsyncIterator[Record]:
    """Count a stream of events, and give its job before it begins.

    Parameters
    ----------
    reader : Caller
    identifier : str

    Yields
    ------
    Record

    Raises
    ------
    NoSuchJob
        If there is no such job.
    Problem
        If the user has too many streams open.
    """
    service = reader.service
    with service.streams.counted(reader.user):
        yield await service.look_up(service.jobs.records.one, identifier)


@router.get("/jobs/{identifier}/events", response_class=EventSourceResponse, responses=NO_SUCH_JOB)
async def watch_job(
    request: Request, reader: Reader, record: Annotated[Record, Depends(open_stream)]
) -> AsyncIterator[ServerSentEvent]:
    """Send the present state of the job, and the new one after each change, until the job has finished.

    The stream ends, too, when the token is revoked or expires, and when the server stops. While the
    database or the disk is away a comment says so, and the stream goes on afterwards.

    Parameters
    ----------
    request : Request
    reader : Caller
    record : Record
        The job.

    Yields
    ------
    ServerSentEvent
    """
    service = reader.service
    is_away = False
    yield ServerSentEvent(event="job", raw_data=record.json)
    while not Job.model_validate_json(record.json).status.finished:
        await asyncio.sleep(service.settings.event_seconds)
        if request.state.connection.is_stopping:
            return
        try:
            if not await reader.is_valid():
                return
            latest = await _watched_job(service, record.key)
        except OUTAGES as error:
            if not is_away:
                _log.error("%s: %s", request.url.path, reason(error))
                yield ServerSentEvent(
                    comment="the database cannot be used at the moment; the stream goes on later"
                )
            is_away = True
            continue
        is_away = False
        if latest != record:
            record = latest
            yield ServerSentEvent(event="job", raw_data=record.json)


async def _watched_job(service: Service, identifier: str) -> Record:
    """Return a job as it was a moment ago; all clients that watch one job share the reading."""
    record = service.watched_jobs.get(identifier)
    if record is None:
        record = await service.look_up(service.jobs.records.one, identifier)
        service.watched_jobs[identifier] = record
    return record


@router.get("/jobs/{identifier}/log", response_class=PlainTextResponse, responses=NO_SUCH_JOB)
def get_log(reader: Reader, identifier: JobKey) -> Response:
    """Give the log of the job's processes; of a long log only the end.

    Parameters
    ----------
    reader : Caller
    identifier : str

    Returns
    -------
    Response

    Raises
    ------
    NoSuchJob
        If there is no such job.
    """
    jobs = reader.service.jobs
    return PlainTextResponse(_end_of_log(jobs.log_path(jobs.get(identifier))))


def _end_of_log(path: FilePath) -> bytes:
    if not path.exists():
        return b""
    with path.open("rb") as log:
        log.seek(max(path.stat().st_size - LOG_BYTES, 0))
        return log.read(LOG_BYTES)
