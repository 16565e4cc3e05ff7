"""What somebody who listens to a job is sent: the job, whenever it has changed."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

from sse_starlette import ServerSentEvent

from api.http.service import Service
from api.jobs.job import Job
from ensemble.store import Record


async def job_events(service: Service, record: Record) -> AsyncIterator[ServerSentEvent]:
    """Yield the job as it is, and again each time it changes, until it has finished."""
    yield _event(record)
    while not Job.model_validate_json(record.json).status.finished:
        latest = record
        while latest == record:
            await asyncio.sleep(service.settings.event_seconds)
            latest = await _latest(service, record.key)
        record = latest
        yield _event(record)


async def _latest(service: Service, identifier: str) -> Record:
    """The job as it was a moment ago: those who listen to one job look at it together."""
    record = service.watched.get(identifier)
    if record is None:
        record = await service.look_up(service.jobs.records.one, identifier)
        service.watched[identifier] = record
    return record


def _event(record: Record) -> ServerSentEvent:
    return ServerSentEvent(event="job", data=record.json)
