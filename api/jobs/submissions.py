"""From what a client submits to the question that a job answers."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Self

from cachetools import LRUCache
from pydantic import BaseModel, Field, JsonValue, ValidationError, create_model, model_validator
from pydantic_core import from_json
from starlette.concurrency import run_in_threadpool

from api.jobs.job import KindName
from api.settings import Settings
from ensemble.config.documents import preset_document
from ensemble.config.overrides import override
from ensemble.config.validation import describe
from ensemble.errors import BadInput
from ensemble.questions import Question, kind_of, kinds, preset_question
from solver.scene import Model

MAXIMUM_FIELDS = 10  # invalid fields that one message names
MOST_VALUES = 5000  # that changes may have; 256 vesicles with all their fields have half of that
MOST_CACHED = 256
LONGEST_CACHED = 4096  # bytes


class SubmissionFields(Model):
    """What every submission may have; `Submission` adds a field for each kind of question.

    Attributes
    ----------
    preset : str or None
        Name of a preset.
    set : dict
        Changes by dotted path.
    ranks : int or None
        How many processes the job may use.
    seconds : float or None
        Time limit of an attempt.
    """

    preset: str | None = None
    set: dict[Annotated[str, Field(max_length=200)], JsonValue] = Field({}, max_length=100)
    ranks: int | None = Field(None, ge=1)
    seconds: float | None = Field(None, gt=0)

    @model_validator(mode="after")
    def _one_document(self) -> Self:
        *others, last = names = ("preset", *(kind.kind for kind in kinds()))
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) != 1:
            one_of = f"{', '.join(others)} and {last}"
            raise ValueError(f"give one of {one_of}, not {' and '.join(given) or 'none'}")
        return self


_DOCUMENTS: dict[str, Any] = {kind.kind: (kind.document_type | None, None) for kind in kinds()}
Submission: type[SubmissionFields] = create_model(
    "Submission",
    __base__=SubmissionFields,
    __doc__=(
        "What to answer: a preset by its name, or the document of a question under the name of its kind, "
        "with changes by dotted path. Exactly one of them is given. `ranks` is the number of processes of "
        "the job, `seconds` the time limit of an attempt. By default a question of many runs gets as many "
        "ranks as a job may have, a single run one, and either gets the longest time limit."
    ),
    **_DOCUMENTS,
)


class Estimate(BaseModel):
    """Upper bounds of what a job costs and records; it is refused if one is above its maximum.

    Attributes
    ----------
    runs : int
        How many runs.
    ranks : int
        How many processes the job uses.
    seconds : float or None
        How long the runs are likely to take on these processes, as the newest runs of the store with as many
        vesicles in such a flow did; null if there are none.
    cost : float
        Points × vesicles × time to simulate, over all runs.
    maximum : float
        The most that a job may cost.
    recorded : float
        Numbers that are recorded, over all runs.
    most_recorded : float
        The most that a job may record.
    memory : float
        Bytes that each process of the job needs.
    most_memory : float
        The most that its processes may use together.
    accepted : bool
        Whether the job keeps all limits, on one process.
    """

    runs: int
    ranks: int = 1
    seconds: float | None = None
    cost: float
    maximum: float
    recorded: float
    most_recorded: float
    memory: float
    most_memory: float
    accepted: bool


@dataclass(frozen=True)
class JobLimits:
    """What a job may cost, whatever it asks.

    Attributes
    ----------
    cost : float
        Points × vesicles × time to simulate, over all runs.
    recorded : float
        Numbers that it records, over all runs.
    memory : float
        Bytes that its processes use together.
    """

    cost: float
    recorded: float
    memory: float


def job_limits(settings: Settings) -> JobLimits:
    """Return what the settings allow a job to cost.

    Parameters
    ----------
    settings : Settings

    Returns
    -------
    JobLimits
    """
    return JobLimits(settings.maximum_cost, settings.maximum_recorded, settings.maximum_memory)


def estimate(question: Question[Any], limits: JobLimits) -> Estimate:
    """Compare the cost of a question with the most that a job may cost.

    Parameters
    ----------
    question : Question
        What the job answers.
    limits : JobLimits
        The most that it may cost.

    Returns
    -------
    Estimate

    Raises
    ------
    BadInput
        If a run would record more than it may; names the interval and its least value.
    """
    try:
        cost = question.cost
    except ValueError as error:
        raise BadInput(str(error)) from error
    return Estimate(
        runs=cost.runs,
        cost=min(cost.work, sys.float_info.max),  # JSON has no word for infinity
        maximum=limits.cost,
        recorded=min(cost.recorded, sys.float_info.max),
        most_recorded=limits.recorded,
        memory=min(cost.memory, sys.float_info.max),
        most_memory=limits.memory,
        accepted=(
            cost.work <= limits.cost and cost.recorded <= limits.recorded and cost.memory <= limits.memory
        ),
    )


def usual_ranks(question: Question[Any], estimate: Estimate, settings: Settings) -> int:
    """Return how many processes a job uses that does not say how many.

    Parameters
    ----------
    question : Question
        What the job answers.
    estimate : Estimate
        Of the question.
    settings : Settings
        That limit ranks and memory.

    Returns
    -------
    int
        As many as it may, for a question of many runs.
    """
    return max(most_ranks(estimate, settings), 1) if question.has_many_runs else 1


def most_ranks(estimate: Estimate, settings: Settings) -> int:
    """Return how many processes a job may use.

    Parameters
    ----------
    estimate : Estimate
        Of the question.
    settings : Settings
        That limit ranks and memory.

    Returns
    -------
    int
    """
    return min(settings.maximum_ranks, int(estimate.most_memory // estimate.memory))


class PresetDocument(BaseModel):
    """A preset with all of its fields, and its largest cost.

    Attributes
    ----------
    name : str
    kind : str
        Which kind of question it asks.
    document : dict
    estimate : Estimate
    """

    name: str
    kind: KindName
    document: dict[str, Any]
    estimate: Estimate


@dataclass(frozen=True)
class CheckedSubmission:
    """A submission that has been checked, and what it may cost.

    Attributes
    ----------
    submission : SubmissionFields
        What was sent.
    question : Question
        With the changes made.
    estimate : Estimate
        Of its cost.
    """

    submission: SubmissionFields
    question: Question[Any]
    estimate: Estimate


class Submissions:
    """Checks submissions, in the event loop of a service.

    The latest short ones are cached by their bytes: many clients submit the same preset, or ask for a cost
    and then for the job.

    Parameters
    ----------
    limits : JobLimits
        The most that a job may cost.
    """

    def __init__(self, limits: JobLimits) -> None:
        self._limits = limits
        self._cache: LRUCache[bytes, CheckedSubmission] = LRUCache(MOST_CACHED)

    async def read(self, body: bytes) -> CheckedSubmission:
        """Check a submission.

        Parameters
        ----------
        body : bytes
            JSON.

        Returns
        -------
        CheckedSubmission

        Raises
        ------
        BadInput
            If it is not possible; names the field.
        """
        checked = self._cache.get(body)
        if checked is None:
            # In another thread: a study may have many points, and a scene many vesicles to place.
            checked = await run_in_threadpool(self._check, body)
            if len(body) <= LONGEST_CACHED:
                self._cache[body] = checked
        return checked

    def _check(self, body: bytes) -> CheckedSubmission:
        submission = read_submission(body)
        question = submitted_question(submission)
        return CheckedSubmission(submission, question, estimate(question, self._limits))


def read_submission(body: bytes) -> SubmissionFields:
    """Read a submission strictly: text and truth values are not taken for numbers.

    Parameters
    ----------
    body : bytes
        JSON.

    Returns
    -------
    SubmissionFields
        A `Submission`.

    Raises
    ------
    BadInput
        If it is too large or not valid; names the fields.
    """
    try:
        document = from_json(body)
        if isinstance(document, dict):
            _limit_values(document.get("set"))
            for kind in kinds():
                kind.check_size(document.get(kind.kind))
        return Submission.model_validate_json(body, strict=True, context={})
    except ValidationError as error:
        errors = error.errors(include_url=False)[:MAXIMUM_FIELDS]
        raise BadInput(describe(errors, document if isinstance(document, dict) else {})) from error
    except ValueError as error:
        raise BadInput(f"body: {error}") from error


def _limit_values(changes: Any) -> None:
    """Refuse changes of too many values: each is copied into the document several times."""
    values, rest = 0, [changes]
    while rest:
        node = rest.pop()
        values += 1
        if values > MOST_VALUES:
            raise ValueError(f"set has too many values — must have at most {MOST_VALUES}")
        if isinstance(node, dict | list):
            rest += node.values() if isinstance(node, dict) else node


def submitted_question(submission: SubmissionFields) -> Question[Any]:
    """Return the question that a submission asks, with its changes made.

    Parameters
    ----------
    submission : SubmissionFields
        A `Submission`.

    Returns
    -------
    Question

    Raises
    ------
    BadInput
        If there is no such preset, or a change is not possible; names the field.
    """
    changes = submission.set
    try:
        if submission.preset is not None:
            document = preset_document(submission.preset)
            _check_size(kind_of(document), document, changes)
            return preset_question(submission.preset, changes)
        (question,) = (
            kind(getattr(submission, kind.kind))
            for kind in kinds()
            if getattr(submission, kind.kind) is not None
        )
        _check_size(type(question), question.document.model_dump(mode="json"), changes)
        return question.changed(changes)
    except ValueError as error:
        raise BadInput(str(error)) from error


def _check_size(kind: type[Question[Any]], document: dict[str, Any], changes: Mapping[str, Any]) -> None:
    """Refuse a document that is too large with these changes."""
    # To change the vesicles of an arrangement it has to be placed first, so its own size is checked before.
    others = {path: changes[path] for path in changes if "vesicles" not in path.split(".")}
    kind.check_size(override(document, others))
    if len(others) < len(changes):
        kind.check_size(override(document, changes))
