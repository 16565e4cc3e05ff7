"""A job: what was asked for, and where it stands."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cache, cached_property
from typing import Any

from pydantic import BaseModel, ConfigDict

from ensemble.config.documents import preset_document
from ensemble.config.overrides import override
from ensemble.config.run_key import run_key
from ensemble.config.study import Study
from ensemble.config.validation import validated
from ensemble.errors import BadInput, EnsembleError
from ensemble.timestamp import Timestamp
from solver.scene import Scene


class Kind(StrEnum):
    """What a job carries out."""

    STUDY = "study"
    SCENE = "scene"


class JobStatus(StrEnum):
    """Where a job stands; the words are those of OGC API Processes."""

    ACCEPTED = "accepted"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    DISMISSED = "dismissed"

    @property
    def finished(self) -> bool:
        """Whether it is the last one that a job has."""
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
    owner : str
    kind : Kind
    name : str
        Of the study, or of the preset that the scene was made from.
    key : str
        Of the boundary or the run that the job makes: it is in the store as soon as something is known.
    ranks : int
        Processes that the job uses.
    seconds : float
        How long one attempt may take.
    status : JobStatus
    progress : int
        From 0 to 100.  It never falls.
    message : str
        What there is to say about the status.
    attempts : int
        How often it has been started.  An attempt that was cut short is followed by another one, which
        repeats nothing that is in the store.
    created, started, finished, updated : datetime or None
        `started` is when the first attempt was.
    """

    model_config = ConfigDict(frozen=True, from_attributes=True)

    id: str
    owner: str
    kind: Kind
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
class Work:
    """What a job is to do: a study or a scene that has been checked, and what it is called."""

    name: str
    model: Study | Scene

    @property
    def kind(self) -> Kind:
        """Which of the two it is."""
        return Kind.STUDY if isinstance(self.model, Study) else Kind.SCENE

    @cached_property
    def key(self) -> str:
        """Key of the boundary or the run that comes of it."""
        return self.model.key if isinstance(self.model, Study) else run_key(self.model)

    @cached_property
    def text(self) -> str:
        """The document as JSON, the same for equal documents."""
        return json.dumps(self.document, sort_keys=True)

    @cached_property
    def document(self) -> dict[str, Any]:
        """The whole of it as a document in which nothing is left to a default."""
        return self.model.model_dump(mode="json", exclude_none=True)


def preset_work(name: str, changes: Mapping[str, Any]) -> Work:
    """Return the work that a preset describes, with the values at some dotted paths replaced.

    Raises
    ------
    ValueError
        If there is no such preset, or it does not allow one of the changes; names the field.
    """
    return _of_document(name, override(preset_document(name), changes)) if changes else _plain_preset(name)


@cache
def _plain_preset(name: str) -> Work:
    """Check a preset once: most jobs are one as it is."""
    return _of_document(name, preset_document(name))


def _of_document(name: str, document: dict[str, Any]) -> Work:
    if "search" in document:
        study = validated(Study, document)
        return Work(study.name, study)
    return Work(name, validated(Scene, document))


def study_work(study: Study, changes: Mapping[str, Any]) -> Work:
    """Return the work that a study describes, with the values at some dotted paths replaced.

    Raises
    ------
    ValueError
        If the study does not allow one of the changes; names the field.
    """
    changed = validated(Study, override(study.model_dump(), changes)) if changes else study
    return Work(changed.name, changed)


def scene_work(scene: Scene, changes: Mapping[str, Any]) -> Work:
    """Return the work that a scene describes, with the values at some dotted paths replaced.

    Raises
    ------
    ValueError
        If the scene does not allow one of the changes; names the field.
    """
    return Work("scene", validated(Scene, override(scene.model_dump(), changes)) if changes else scene)


@dataclass(frozen=True)
class Lease:
    """The right to carry out a job, until it runs out or is renewed.

    The number of the attempt is the fencing token: whoever holds an earlier one can change nothing any more.
    """

    job: Job
    document: Mapping[str, Any]
