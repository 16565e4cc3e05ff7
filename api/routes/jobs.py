"""Jobs: submitted, watched, dismissed."""

from __future__ import annotations

import asyncio
from http import HTTPStatus
from pathlib import Path as FilePath
from typing import Annotated

from fastapi import APIRouter, Header, Path, Query, Request, Response
from fastapi.responses import PlainTextResponse
from sse_starlette import EventSourceResponse

from api.auth.callers import Reader, Submitter
from api.auth.scope import Scope
from api.http.caching import written
from api.http.openapi import reference
from api.http.paging import Limit, page
from api.http.problems import Problem, documented
from api.http.schemas import Estimate, Page, Submission
from api.jobs.job import Job, Kind, NoSuchJob, Status, TooManyJobs
from api.jobs.job_events import job_events
from api.jobs.submissions import Asked, Body
from api.settings import Settings
from ensemble.errors import BadInput

router = APIRouter(tags=["jobs"])

JobKey = Annotated[str, Path(pattern="^[0-9a-z-]{1,64}$", description="Identifier of the job.")]
LOG_BYTES = 1 << 20
BODY = {"requestBody": {"required": True, "content": {"application/json": {"schema": reference(Submission)}}}}
UNSUPPORTED = documented(HTTPStatus.UNSUPPORTED_MEDIA_TYPE)
NO_SUCH_JOB = documented(HTTPStatus.NOT_FOUND)


@router.post("/estimate", openapi_extra=BODY, responses=UNSUPPORTED)
async def estimate_cost(reader: Reader, body: Body) -> Estimate:
    """Say what a job may cost, without submitting it."""
    return (await reader.service.submissions.read(body)).estimate


@router.post(
    "/jobs", status_code=HTTPStatus.ACCEPTED, response_model=Job, openapi_extra=BODY, responses=UNSUPPORTED
)
async def submit_job(
    submitter: Submitter,
    body: Body,
    idempotency_key: Annotated[
        str | None,
        Header(min_length=1, max_length=200, description="However often a request comes with it: one job."),
    ] = None,
) -> Response:
    """Accept a job; it is on disk when this is answered."""
    service = submitter.service
    asked = await service.submissions.read(body)
    ranks, seconds = _resources(service.settings, asked)
    offer = service.jobs.offer(
        asked.work, submitter.user, ranks, seconds, idempotency_key, service.settings.maximum_jobs
    )
    # Not awaited itself: should the client go away, that must not cancel what shares its transaction.
    await asyncio.wait([asyncio.wrap_future(offer.accepted)])
    try:
        submitted = await service.look_up(service.jobs.settled, offer)
    except TooManyJobs as error:
        raise Problem(HTTPStatus.TOO_MANY_REQUESTS, str(error)) from error
    response = written(submitted.job)
    response.status_code = HTTPStatus.ACCEPTED
    response.headers["Location"] = f"/jobs/{submitted.job.id}"
    return response


def _resources(settings: Settings, asked: Asked) -> tuple[int, float]:
    """On how many ranks a job runs, and how long an attempt may take."""
    cost = asked.estimate
    if not cost.accepted:
        raise Problem(
            HTTPStatus.UNPROCESSABLE_ENTITY,
            f"cost: {cost.cost:.3g} — must be at most {cost.maximum:.3g} "
            "(points × vesicles × time to simulate, over all runs)",
            cost=cost.cost,
            maximum=cost.maximum,
        )
    ranks = asked.submission.ranks or (settings.maximum_ranks if asked.work.kind is Kind.STUDY else 1)
    seconds = asked.submission.seconds or settings.maximum_seconds
    if ranks > settings.maximum_ranks:
        raise BadInput(f"ranks: {ranks} — must be at most {settings.maximum_ranks}")
    if seconds > settings.maximum_seconds:
        raise BadInput(f"seconds: {seconds:g} — must be at most {settings.maximum_seconds:g}")
    return ranks, seconds


@router.get("/jobs", response_model=Page[Job])
async def list_jobs(
    request: Request,
    reader: Reader,
    owner: Annotated[str | None, Query(max_length=64)] = None,
    status: Status | None = None,
    after: Annotated[
        str | None, Query(pattern="^[0-9a-z-]{1,64}$", description="The job before the first.")
    ] = None,
    limit: Limit = 100,
) -> Response:
    """List the jobs, the latest first."""
    try:
        found = await reader.service.look_up(
            reader.service.jobs.records.page, limit + 1, after, owner, status
        )
    except NoSuchJob:
        raise BadInput(f"after: there is no job {after}") from None
    return page(request, found, limit)


@router.get("/jobs/{identifier}", response_model=Job, responses=NO_SUCH_JOB)
async def get_job(reader: Reader, identifier: JobKey) -> Response:
    """Say where a job stands."""
    record = await reader.service.look_up(reader.service.jobs.records.one, identifier)
    return written(record.json)


@router.delete("/jobs/{identifier}", responses=NO_SUCH_JOB)
def dismiss_job(submitter: Submitter, identifier: JobKey) -> Job:
    """Give a job up: no process of it is left a moment later.  A finished job stays as it is."""
    owner = submitter.service.jobs.get(identifier).owner
    if submitter.user != owner and not submitter.scope.includes(Scope.ADMIN):
        raise Problem(HTTPStatus.FORBIDDEN, "Authorization: only its owner or an admin may dismiss a job")
    return submitter.service.jobs.dismiss(identifier)


@router.get(
    "/jobs/{identifier}/events",
    response_class=EventSourceResponse,
    responses=NO_SUCH_JOB
    | {HTTPStatus.OK.value: {"description": "Server-sent events.", "content": {"text/event-stream": {}}}},
)
async def listen_to_job(reader: Reader, identifier: JobKey) -> EventSourceResponse:
    """Send the job as it is, and again each time it changes, until it has finished."""
    record = await reader.service.look_up(reader.service.jobs.records.one, identifier)
    return EventSourceResponse(job_events(reader.service, record))


@router.get("/jobs/{identifier}/log", response_class=PlainTextResponse, responses=NO_SUCH_JOB)
def get_log(reader: Reader, identifier: JobKey) -> Response:
    """Give what the job's processes have said so far; of a long log the end."""
    jobs = reader.service.jobs
    return PlainTextResponse(_tail(jobs.log_path(jobs.get(identifier))))


def _tail(path: FilePath) -> bytes:
    if not path.exists():
        return b""
    with path.open("rb") as log:
        log.seek(max(path.stat().st_size - LOG_BYTES, 0))
        return log.read(LOG_BYTES)
