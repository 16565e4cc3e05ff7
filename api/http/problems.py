"""Errors as RFC 9457 describes them: `application/problem+json`, one shape for all."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict
from pydantic_core import ErrorDetails
from starlette.exceptions import HTTPException

from api.jobs.job import NoSuchJob
from ensemble.config.validation import describe
from ensemble.errors import BadInput
from ensemble.store import NotStored

MEDIA_TYPE = "application/problem+json"
MOST_FOUND = 10  # wrong fields that one answer names


class ProblemDocument(BaseModel):
    """What is wrong with a request: `title` names the status, `detail` the field and what is allowed.

    Some problems carry further members, such as `cost` and `maximum`.
    """

    model_config = ConfigDict(extra="allow")

    type: str = "about:blank"
    title: str
    status: int
    detail: str


class Problem(Exception):  # noqa: N818
    """Answers the request with a problem.

    Parameters
    ----------
    status : HTTPStatus
    detail : str
        One sentence that names the field and what it allows.
    headers : mapping, optional
        Of the answer.
    members
        Further members of the document.
    """

    def __init__(
        self, status: HTTPStatus, detail: str, headers: Mapping[str, str] | None = None, **members: Any
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.detail = detail
        self.headers = headers
        self.members = members


def problem_response(problem: Problem) -> Response:
    """Write a problem as a response."""
    document = ProblemDocument(
        title=problem.status.phrase, status=problem.status, detail=problem.detail, **problem.members
    )
    # Escaped to ASCII: what is quoted from a request may hold characters that UTF-8 has no bytes for.
    return Response(
        json.dumps(document.model_dump(mode="json")),
        status_code=problem.status,
        headers=dict(problem.headers or {}),
        media_type=MEDIA_TYPE,
    )


def invalid(found: Sequence[ErrorDetails]) -> Problem:
    """Make the problem of a document, or a query, in which pydantic has found fields that are wrong."""
    return Problem(HTTPStatus.UNPROCESSABLE_ENTITY, describe(found[:MOST_FOUND], {}))


def documented(*statuses: HTTPStatus) -> dict[int | str, dict[str, Any]]:
    """Describe in OpenAPI that a route may answer with these problems."""
    schema = {"schema": {"$ref": "#/components/schemas/ProblemDocument"}}
    return {
        status.value: {"description": status.phrase, "content": {MEDIA_TYPE: schema}} for status in statuses
    }


def install(app: FastAPI) -> None:
    """Make every error of an application a problem."""
    app.add_exception_handler(Problem, _of_problem)
    app.add_exception_handler(HTTPException, _of_http)
    app.add_exception_handler(RequestValidationError, _of_validation)
    app.add_exception_handler(BadInput, _of_bad_input)
    app.add_exception_handler(NotStored, _of_missing)
    app.add_exception_handler(NoSuchJob, _of_missing)
    app.add_exception_handler(Exception, _of_accident)


def _of_problem(_: Request, error: Exception) -> Response:
    assert isinstance(error, Problem)
    return problem_response(error)


def _of_http(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    status = HTTPStatus(error.status_code)
    headers = dict(error.headers or {})
    if status is HTTPStatus.METHOD_NOT_ALLOWED:
        # The framework names the methods of the first of several routes at this path.
        described = request.app.openapi()["paths"].get(request.scope["route"].path, {})
        headers["Allow"] = ", ".join(sorted(described)).upper() or headers["Allow"]
    return problem_response(Problem(status, error.detail, headers))


def _of_validation(_: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    # The first part of a location says where it was: in the query, the path or a header.
    return problem_response(invalid([problem | {"loc": problem["loc"][1:]} for problem in error.errors()]))


def _of_missing(request: Request, _: Exception) -> Response:
    return problem_response(Problem(HTTPStatus.NOT_FOUND, f"there is nothing at {request.url.path}"))


def _of_bad_input(_: Request, error: Exception) -> Response:
    return problem_response(Problem(HTTPStatus.UNPROCESSABLE_ENTITY, str(error)))


def _of_accident(_: Request, __: Exception) -> Response:
    # What went wrong is in the server's log, and no business of a client's.
    return problem_response(
        Problem(HTTPStatus.INTERNAL_SERVER_ERROR, "the server made a mistake; it is logged")
    )
