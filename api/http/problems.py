"""Errors in one form for all routes: `application/problem+json` (RFC 9457)."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterable, Mapping, Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict
from pydantic_core import ErrorDetails
from sqlalchemy.exc import InterfaceError, InternalError, OperationalError
from sqlalchemy.exc import TimeoutError as NoConnectionLeft
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from ensemble.config.validation import describe
from ensemble.errors import BadInput, StoreError, UnfinishedRunError
from ensemble.store.sql_database import reason

MEDIA_TYPE = "application/problem+json"
MAXIMUM_FIELDS = 10  # invalid fields that one answer names
LONGEST_DETAIL = 2000  # characters
RETRY_SECONDS = 10  # after which a client may ask again where the database did not answer

# What is raised while the database or the disk is away or read-only: it passes without a
# change of the request. An `InternalError` is that of a server which has become a read-only copy.
OUTAGES = (OperationalError, InterfaceError, InternalError, NoConnectionLeft, OSError)

_log = logging.getLogger("uvicorn.error")


class ProblemDocument(BaseModel):
    """An error: `title` is the name of the status, `detail` names the field and the allowed range.

    Some problems have additional members, for example `cost` and `maximum`.
    """

    model_config = ConfigDict(extra="allow")

    type: str = "about:blank"
    title: str
    status: int
    detail: str


class Problem(Exception):  # noqa: N818
    """An error that becomes the answer to the request.

    Parameters
    ----------
    status : HTTPStatus
        Status of the answer.
    detail : str
        One sentence that names the field and the allowed range.
    headers : mapping, optional
        Headers of the answer.
    **members
        Additional members of the document.
    """

    def __init__(
        self, status: HTTPStatus, detail: str, headers: Mapping[str, str] | None = None, **members: Any
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.detail = detail
        self.headers = headers
        self.members = members


def documented(*statuses: HTTPStatus) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI description of problems that a route may answer with.

    Parameters
    ----------
    *statuses : HTTPStatus
        Statuses of the problems.

    Returns
    -------
    dict
        For the argument `responses` of a route.
    """
    schema = {"schema": {"$ref": "#/components/schemas/ProblemDocument"}}
    return {
        status.value: {"description": status.phrase, "content": {MEDIA_TYPE: schema}} for status in statuses
    }


def install_handlers(app: FastAPI, missing: Iterable[type[Exception]]) -> None:
    """Turn every error of an application into a problem.

    Parameters
    ----------
    app : FastAPI
    missing : iterable of type
        Exceptions that mean that there is no such resource: status 404.
    """
    app.add_exception_handler(Problem, _problem)
    app.add_exception_handler(HTTPException, _http_error)
    app.add_exception_handler(RequestValidationError, _validation_error)
    app.add_exception_handler(BadInput, _bad_input)
    app.add_exception_handler(StoreError, _damage)
    app.add_exception_handler(UnfinishedRunError, _useless_checkpoint)
    app.add_exception_handler(ClientDisconnect, _incomplete_body)
    for trouble in OUTAGES:
        app.add_exception_handler(trouble, _outage)
    for error in missing:
        app.add_exception_handler(error, _missing_resource)
    app.add_exception_handler(Exception, _server_error)


def problem_response(problem: Problem) -> Response:
    """Return the answer that a problem becomes.

    Parameters
    ----------
    problem : Problem

    Returns
    -------
    Response
    """
    detail = problem.detail  # may quote what a client has sent
    if len(detail) > LONGEST_DETAIL:
        detail = f"{detail[:LONGEST_DETAIL]}…"
    document = ProblemDocument(
        title=problem.status.phrase, status=problem.status, detail=detail, **problem.members
    )
    # Escaped to ASCII: the detail may quote characters of the request that cannot be encoded as UTF-8.
    return Response(
        json.dumps(document.model_dump(mode="json")),
        status_code=problem.status,
        headers=dict(problem.headers or {}),
        media_type=MEDIA_TYPE,
    )


def _problem(_: Request, error: Exception) -> Response:
    assert isinstance(error, Problem)
    return problem_response(error)


def _http_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    status = HTTPStatus(error.status_code)
    headers = dict(error.headers or {})
    if status is HTTPStatus.METHOD_NOT_ALLOWED:
        # The framework names the methods of the first route at this path; there may be several.
        path = getattr(request.scope.get("route"), "path", None)  # the description itself has no route
        described = request.app.openapi()["paths"].get(path, {})
        headers["Allow"] = ", ".join(sorted(described)).upper() or headers["Allow"]
    return problem_response(Problem(status, error.detail, headers))


def _validation_error(_: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    # The first part of a location is "query", "path" or "header".
    errors: Sequence[ErrorDetails] = [details | {"loc": details["loc"][1:]} for details in error.errors()]
    return problem_response(Problem(HTTPStatus.UNPROCESSABLE_ENTITY, describe(errors[:MAXIMUM_FIELDS], {})))


def _bad_input(_: Request, error: Exception) -> Response:
    return problem_response(Problem(HTTPStatus.UNPROCESSABLE_ENTITY, str(error)))


def _incomplete_body(_: Request, __: Exception) -> Response:
    # Nobody reads it, but the request is counted, and the log is not filled by clients that go away.
    return problem_response(Problem(HTTPStatus.BAD_REQUEST, "body: the connection was closed before its end"))


def _damage(request: Request, error: Exception) -> Response:
    # The paths that the error may name are for the log only.
    _log.error("%s: %s", request.url.path, error)
    detail = (
        "what is stored is damaged; `ensemble check --repair` sets it aside, so that it can be made again"
    )
    return problem_response(Problem(HTTPStatus.CONFLICT, detail))


def _useless_checkpoint(request: Request, error: Exception) -> Response:
    _log.error("%s: %s", request.url.path, error)
    return problem_response(Problem(HTTPStatus.CONFLICT, str(error)))


def unavailable(what: str) -> Problem:
    """Return the problem that a client may ask again later.

    Parameters
    ----------
    what : str
        Which part cannot be used, and why.

    Returns
    -------
    Problem
        503 with `Retry-After`.
    """
    return Problem(HTTPStatus.SERVICE_UNAVAILABLE, what, {"Retry-After": str(RETRY_SECONDS)})


def _outage(request: Request, error: Exception) -> Response:
    # The paths that the error may name are for the log only.
    _log.error("%s: %s", request.url.path, reason(error))
    if isinstance(error, OSError) and not isinstance(error, TimeoutError):
        return problem_response(
            unavailable(f"the store cannot be used at the moment: {error.strerror or 'disk error'}")
        )
    cause = "its disk is full" if "full" in reason(error) else "it does not answer or cannot be written to"
    return problem_response(unavailable(f"the database cannot be used at the moment: {cause}"))


def _missing_resource(request: Request, _: Exception) -> Response:
    return problem_response(Problem(HTTPStatus.NOT_FOUND, f"there is nothing at {request.url.path}"))


def _server_error(_: Request, __: Exception) -> Response:
    # Details are in the server's log only: they are of no use to a client and may reveal internals.
    return problem_response(
        Problem(HTTPStatus.INTERNAL_SERVER_ERROR, "internal error of the server; its log has the details")
    )
