"""From what somebody submits to the work that a job carries out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Self

from cachetools import LRUCache
from pydantic import BaseModel, Field, JsonValue, ValidationError, model_validator
from pydantic_core import from_json
from starlette.concurrency import run_in_threadpool

from api.jobs.cost_estimate import Estimate, estimate
from api.jobs.job import Kind, Work, preset_work, scene_work, study_work
from api.jobs.size_limits import limit_scene, limit_study
from ensemble.config.documents import preset_document
from ensemble.config.overrides import override
from ensemble.config.study import Study
from ensemble.config.validation import describe
from ensemble.errors import BadInput
from solver.scene import Model, Scene

MAXIMUM_FIELDS = 10  # invalid fields that one message names
MOST_KNOWN = 256
LONGEST_KNOWN = 4096  # bytes


class Submission(Model):
    """What to simulate: a preset by its name, a study or a scene, with changes by dotted path.

    Exactly one of `preset`, `study` and `scene` is given. `ranks` is the number of processes of the job,
    `seconds` the time limit of an attempt. By default a study gets as many ranks as a job may have, a scene
    one, and either gets the longest time limit.
    """

    preset: str | None = None
    study: Study | None = None
    scene: Scene | None = None
    set: dict[Annotated[str, Field(max_length=200)], JsonValue] = Field({}, max_length=100)
    ranks: int | None = Field(None, ge=1)
    seconds: float | None = Field(None, gt=0)

    @model_validator(mode="after")
    def _one_document(self) -> Self:
        given = [name for name in ("preset", "study", "scene") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"give one of preset, study and scene, not {' and '.join(given) or 'none'}")
        return self


class PresetDocument(BaseModel):
    """A study or a scene that ships with the package, with all fields, and its largest cost."""

    name: str
    kind: Kind
    document: dict[str, Any]
    estimate: Estimate


@dataclass(frozen=True)
class Asked:
    """A submission that has been checked, and what it may cost."""

    submission: Submission
    work: Work
    estimate: Estimate


class Submissions:
    """Checks submissions, in the event loop of a service.

    The latest short ones are kept by what was sent, since many ask for the same preset, or for a cost and
    then for the job.
    """

    def __init__(self, maximum_cost: float) -> None:
        self._maximum_cost = maximum_cost
        self._known: LRUCache[bytes, Asked] = LRUCache(MOST_KNOWN)

    async def read(self, body: bytes) -> Asked:
        """Return what is asked for.

        Raises
        ------
        BadInput
            If it is nothing that can be done; names the field.
        """
        asked = self._known.get(body)
        if asked is None:
            # Elsewhere, since a study may have many points, and a scene many vesicles to find places for.
            asked = await run_in_threadpool(self._check, body)
            if len(body) <= LONGEST_KNOWN:
                self._known[body] = asked
        return asked

    def _check(self, body: bytes) -> Asked:
        submission = read_submission(body)
        work = requested(submission)
        return Asked(submission, work, estimate(work.model, self._maximum_cost))


def read_submission(body: bytes) -> Submission:
    """Read a submission, strictly: a word is no number, and neither is true or false."""
    try:
        document = from_json(body)
        if isinstance(document, dict):
            limit_study(document.get("study"))
            limit_scene(document.get("scene"))
        return Submission.model_validate_json(body, strict=True)
    except ValidationError as error:
        errors = error.errors(include_url=False)[:MAXIMUM_FIELDS]
        raise BadInput(describe(errors, {})) from error
    except ValueError as error:
        raise BadInput(f"body: {error}") from error


def requested(submission: Submission) -> Work:
    """Return the work that a submission asks for, with its changes made.

    Raises
    ------
    BadInput
        If there is no such preset, or it is no study or scene after the changes; names the field.
    """
    try:
        if submission.preset is not None:
            document = preset_document(submission.preset)
            _limit(kind_of(document), document, submission.set)
            return preset_work(submission.preset, submission.set)
        if submission.study is not None:
            _limit(Kind.STUDY, submission.study.model_dump(mode="json"), submission.set)
            return study_work(submission.study, submission.set)
        assert submission.scene is not None, "a submission has one of the three"
        _limit(Kind.SCENE, submission.scene.model_dump(mode="json"), submission.set)
        return scene_work(submission.scene, submission.set)
    except ValueError as error:
        raise BadInput(str(error)) from error


def kind_of(document: dict[str, Any]) -> Kind:
    """Tell a document of a study, which has a search, from that of a scene."""
    return Kind.STUDY if "search" in document else Kind.SCENE


def _limit(kind: Kind, document: dict[str, Any], changes: Mapping[str, Any]) -> None:
    """Refuse a document that is too large with these changes."""
    limit = limit_study if kind is Kind.STUDY else limit_scene
    # To change the vesicles of an arrangement they have to be found places first, which takes its time.
    others = {path: changes[path] for path in changes if "vesicles" not in path.split(".")}
    limit(override(document, others))
    if len(others) < len(changes):
        limit(override(document, changes))
