"""Kinds of question that jobs answer."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any, Self

from fastapi import APIRouter
from pydantic import BaseModel
from starlette.exceptions import HTTPException

from api.http.paging import CollectionPage
from api.http.problems import documented
from api.jobs.job import KindName
from api.routes.service import Reader
from ensemble.config.document_schema import document_schema
from ensemble.questions import Question, kind_named, kinds

router = APIRouter(prefix="/kinds", tags=["kinds"])


class KindDescription(BaseModel):
    """What a client has to know about a kind of question.

    Attributes
    ----------
    kind : str
        Its name in jobs, presets and submissions.
    title : str
        What a job of this kind does, in the imperative.
    collection : str or None
        Collection of the service that has the answers by their keys; null if only their runs are kept.
    answer_title : str
        What one answer is called.
    answer_grows : bool
        Whether the answer, as far as it is known, is in the collection while the job runs.
    has_many_runs : bool
        Whether an answer takes many runs.
    scene_path : str
        Dotted path of the scene in the documents; empty if they are scenes.
    principal_fields : list of str
        Fields outside the scene that people change most, by their dotted paths.
    """

    kind: str
    title: str
    collection: str | None
    answer_title: str
    answer_grows: bool
    has_many_runs: bool
    scene_path: str
    principal_fields: list[str]

    @classmethod
    def of(cls, kind: type[Question[Any]]) -> Self:
        """Return the description of a kind.

        Parameters
        ----------
        kind : type
            A subclass of `Question`.

        Returns
        -------
        KindDescription
        """
        return cls(**{name: getattr(kind, name) for name in cls.model_fields})


@router.get("")
def list_kinds(reader: Reader) -> CollectionPage[KindDescription]:
    """List the kinds of question that jobs answer.

    Parameters
    ----------
    reader : Caller

    Returns
    -------
    CollectionPage
    """
    return CollectionPage(items=[KindDescription.of(kind) for kind in kinds()], next=None)


@router.get("/{kind}/schema", responses=documented(HTTPStatus.NOT_FOUND))
def get_schema(reader: Reader, kind: KindName) -> dict[str, Any]:
    """Give the JSON Schema of the documents of a kind: fields with descriptions, units and allowed values.

    Parameters
    ----------
    reader : Caller
    kind : str

    Returns
    -------
    dict
    """
    try:
        return document_schema(kind_named(kind).document_type)
    except ValueError as error:
        raise HTTPException(HTTPStatus.NOT_FOUND, str(error)) from error
