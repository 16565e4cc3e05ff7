"""What somebody who listens to a job is sent: the job, whenever it has changed."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

from sse_starlette import ServerSentEvent

from api.job import Job
from api.service import Service


async def job_events(service: Service, job: Job) -> AsyncIterator[ServerSentEvent]:
    """Yield the job as it is, and again each time it changes, until it has finished."""
    yield _event(job)
    while not job.status.finished:
        await asyncio.sleep(service.settings.event_seconds)
        latest = await service.look_up(service.jobs.get, job.id)
        if latest != job:
            yield _event(latest)
        job = latest


def _event(job: Job) -> ServerSentEvent:
    return ServerSentEvent(event="job", data=job.model_dump_json())
