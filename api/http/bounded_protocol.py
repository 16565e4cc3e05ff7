"""HTTP/1.1 in which every phase of a connection has its time and its size."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto
from http import HTTPStatus
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from api.http.middleware import ENCODED_HEADERS
from api.http.problems import Problem, problem_response

_END_OF_HEAD = b"\r\n\r\n"
_GRACE_SECONDS = 1.0  # for the application to answer that a body was too slow, before the connection ends
_WIRE = 8  # most bytes that are sent for a byte of a body: chunks of one byte have five more around it


@dataclass(frozen=True)
class ConnectionLimits:
    """Limits for the phases of a connection.

    Attributes
    ----------
    head_bytes : int
        Largest size of a request line with its headers.
    head_seconds : float
        Time within which a head must arrive, from the start of the connection or of the request.
    body_bytes : int
        Largest body; also the most that is read after the answer.
    body_seconds : float
        Time within which a body must arrive, whether or not it is read.
    answer_seconds : float
        Time within which a client must read what has been sent, so that there is room for more.
    idle_seconds : float
        Time from an answer to the next request.
    """

    head_bytes: int
    head_seconds: float
    body_bytes: int
    body_seconds: float
    answer_seconds: float
    idle_seconds: float


class _Phase(Enum):
    """What is expected from the client."""

    HEAD = auto()
    BODY = auto()
    NOTHING = auto()


class BoundedProtocol(HttpToolsProtocol):
    """Close a connection if a phase of it takes too long or is too large.

    Uvicorn itself limits only the time between requests, and forgets that when a byte arrives. Use
    `bounded_protocol`, which makes a subclass with limits. Routes find it as `request.state.connection`.

    Attributes
    ----------
    is_stopping : bool
        Whether the server stops, so that long answers should end.
    """

    limits: ConnectionLimits
    is_stopping = False
    _phase = _Phase.HEAD
    _received = 0  # bytes in this phase
    _received_after_answer = 0
    _incoming: asyncio.TimerHandle | None = None
    _outgoing: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Expect the head of the first request; see `asyncio.Protocol`.

        Parameters
        ----------
        transport : asyncio.Transport
        """
        super().connection_made(transport)
        self._expect(_Phase.HEAD, self.limits.head_seconds, self._refuse)

    def on_message_begin(self) -> None:
        """Expect the head of a further request on the same connection."""
        super().on_message_begin()
        self.scope["state"]["connection"] = self
        if self._phase is not _Phase.HEAD:
            self._expect(_Phase.HEAD, self.limits.head_seconds, self._refuse)

    def on_headers_complete(self) -> None:
        """Expect the body."""
        self._expect(_Phase.BODY, self.limits.body_seconds + _GRACE_SECONDS, self._close)
        super().on_headers_complete()

    def on_message_complete(self) -> None:
        """Expect nothing until the answer has been sent."""
        super().on_message_complete()
        self._expect(_Phase.NOTHING)
        self._await_next_request()

    def on_response_complete(self) -> None:
        """Expect the next request, or that the client reads the last answer."""
        super().on_response_complete()
        self._received_after_answer = 0
        if self.transport.is_closing():
            self._expect_reader()
        else:
            self._await_next_request()

    def data_received(self, data: bytes) -> None:
        """Check the size of what has arrived and parse it; see `asyncio.Protocol`.

        Parameters
        ----------
        data : bytes
        """
        # Parsing a complete head ends its phase, so a head that ends in this data is measured before.
        remaining_head = max(data.find(_END_OF_HEAD), 0)
        if self._phase is _Phase.HEAD and self._received + remaining_head > self.limits.head_bytes:
            self._refuse()
            return
        self._received += len(data)
        super().data_received(data)  # a phase that begins in this data is counted from the next on
        if self.transport.is_closing():
            return
        if self._phase is _Phase.HEAD and self._received > self.limits.head_bytes:
            self._refuse()
        elif self._phase is _Phase.BODY and self._is_body_too_long(len(data)):
            self._close()

    def _is_body_too_long(self, size: int) -> bool:
        """Tell whether more has arrived than any body needs, or than is read once the answer is sent."""
        if self.cycle.response_complete:
            self._received_after_answer += size
        return (
            self._received > _WIRE * self.limits.body_bytes + self.limits.head_bytes
            or self._received_after_answer > self.limits.body_bytes
        )

    def abort(self) -> None:
        """End an answer at once, so that the client sees that it is incomplete."""
        self.transport.abort()

    def shutdown(self) -> None:
        """Note that the server stops."""
        self.is_stopping = True
        super().shutdown()

    def pause_writing(self) -> None:
        """Expect that the client reads; see `asyncio.Protocol`."""
        super().pause_writing()
        self._expect_reader()

    def resume_writing(self) -> None:
        """Note that the client has read; see `asyncio.Protocol`."""
        super().resume_writing()
        if not self.transport.is_closing():
            _stopped(self._outgoing)

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop all time limits: the connection is closed; see `asyncio.Protocol`.

        Parameters
        ----------
        exc : Exception or None
        """
        _stopped(self._incoming)
        _stopped(self._outgoing)
        super().connection_lost(exc)

    def _expect(
        self, phase: _Phase, seconds: float | None = None, otherwise: Callable[[], None] | None = None
    ) -> None:
        """Begin a phase, which must end within a time or else something is done."""
        _stopped(self._incoming)
        self._phase, self._received = phase, 0
        self._incoming = None if otherwise is None else self.loop.call_later(seconds or 0.0, otherwise)

    def _expect_reader(self) -> None:
        _stopped(self._outgoing)
        self._outgoing = self.loop.call_later(self.limits.answer_seconds, self.transport.abort)

    def _await_next_request(self) -> None:
        """Limit the idle time, if the request has arrived and all answers have been sent."""
        if self._phase is _Phase.NOTHING and self.cycle.response_complete:
            self._expect(_Phase.NOTHING, self.limits.idle_seconds, self._close)

    def send_400_response(self, msg: str) -> None:
        """Answer what is no request of HTTP with a problem, as all else that is refused.

        Parameters
        ----------
        msg : str
            What is wrong.
        """
        answer = problem_response(Problem(HTTPStatus.BAD_REQUEST, msg))
        headers = [*answer.raw_headers, *ENCODED_HEADERS, (b"connection", b"close")]
        lines = [b"HTTP/1.1 400 Bad Request", *(b"%s: %s" % header for header in headers)]
        self.transport.write(b"\r\n".join(lines) + b"\r\n\r\n" + bytes(answer.body))
        self.transport.close()

    def _refuse(self) -> None:
        is_answering = self.cycle is not None and not self.cycle.response_complete
        if not self.transport.is_closing() and not is_answering:
            self.send_400_response("The head of the request is too large or too slow.")
        self._close()

    def _close(self) -> None:
        """Close the connection: at once if an answer is under way or unread."""
        is_answering = self.cycle is not None and not self.cycle.response_complete
        if is_answering:
            self.transport.abort()
            return
        self.transport.close()
        self._expect_reader()


def _stopped(timer: asyncio.TimerHandle | None) -> None:
    if timer is not None:
        timer.cancel()


def bounded_protocol(limits: ConnectionLimits) -> type[BoundedProtocol]:
    """Return a protocol class for uvicorn with these limits.

    Parameters
    ----------
    limits : ConnectionLimits

    Returns
    -------
    type
    """
    members: dict[str, Any] = {"limits": limits}
    return type("LimitedProtocol", (BoundedProtocol,), members)
