"""A job: the question that it answers, and its status."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from ensemble.errors import BadInput, EnsembleError
from ensemble.questions import kinds
from ensemble.timestamp import Timestamp


class _KindNames:
    """Describes in JSON Schema which kinds of question there are."""

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"type": "string", "enum": [kind.kind for kind in kinds()]}


KindName = Annotated[str, _KindNames()]


class JobStatus(StrEnum):
    """Status of a job, in the words of OGC API Processes."""

    ACCEPTED = "accepted"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    DISMISSED = "dismissed"

    @property
    def finished(self) -> bool:
        """Whether it is final."""
        return self not in UNFINISHED


UNFINISHED = (JobStatus.ACCEPTED, JobStatus.RUNNING)


class NoSuchJob(BadInput):
    """There is no job of this identifier."""


class IdempotencyConflict(BadInput):
    """The idempotency key has been used for another request."""


class TooManyJobs(EnsembleError):  # noqa: N818
    """The owner has as many unfinished jobs as one may have."""


class Job(BaseModel):
    """A job as its owner sees it.

    Attributes
    ----------
    id : str
        Unique among all jobs.
    owner : str
        The user who submitted it.
    kind : str
        Which kind of question it answers.
    name : str
        What the question is called.
    key : str
        Of the answer in the store.
    ranks : int
        How many processes the job uses.
    seconds : float
        How long one attempt may take.
    status : JobStatus
        Accepted, running, or how it has ended.
    progress : int
        From 0 to 100.  It never falls.
    message : str
        Explains the status.
    attempts : int
        How often it has been started.  After an attempt that was cut short there is another one, which
        repeats nothing that is in the store.
    created, started, finished, updated : datetime or None
        When it was submitted, first started, finished and last changed.
    """

    model_config = ConfigDict(frozen=True, from_attributes=True)

    id: str
    owner: str
    kind: KindName
    name: str
    key: str
    ranks: int
    seconds: float
    status: JobStatus
    progress: int
    message: str
    attempts: int
    created: Timestamp
    started: Timestamp | None
    finished: Timestamp | None
    updated: Timestamp


@dataclass(frozen=True)
class Lease:
    """The right to carry out a job, until it runs out or is renewed.

    The number of the attempt is the fencing token: a worker with an earlier one can change nothing any more.

    Attributes
    ----------
    job : Job
        As it was leased.
    document : mapping
        The question that it answers, in full.
    reached : float
        How far earlier attempts have come, on the scale of `ensemble.display.progress_line.ProgressLine`.
    crashes : int
        How many of them have ended without an answer since the job last came further.
    """

    job: Job
    document: Mapping[str, Any]
    reached: float
    crashes: int

    def at(self, reached: float) -> Lease:
        """Return the lease of an attempt that has come so far; if that is further, earlier crashes are past.

        Parameters
        ----------
        reached : float
            How far this attempt has come.

        Returns
        -------
        Lease
        """
        return replace(self, reached=reached, crashes=0) if reached > self.reached else self

    def crashed(self) -> Lease:
        """Return the lease of an attempt that has ended without an answer."""
        return replace(self, crashes=self.crashes + 1)
