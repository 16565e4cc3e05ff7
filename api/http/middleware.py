"""ASGI middleware: bodies of requests and answers within limits, headers of answers, counts of requests."""

from __future__ import annotations

import asyncio
import time
from http import HTTPStatus

from prometheus_client import CollectorRegistry, Counter, Histogram
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from api.http.problems import problem_response, unavailable

SECURITY_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; base-uri 'none'; frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
ENCODED_HEADERS = [(name.lower().encode(), value.encode()) for name, value in SECURITY_HEADERS.items()]

PIECE_BYTES = 1 << 16
UNKNOWN_ROUTE = "unknown"  # one label for all paths without a route: clients could invent any number of them


class BodyLimits:
    """Refuse a body that is too large or arrives too slowly.

    A body is checked while a route reads it, so routes that take no body are not affected.

    Parameters
    ----------
    app : ASGIApp
        The application to protect.
    maximum_bytes : int
        Largest body, whether announced by ``Content-Length`` or received.
    seconds : float
        Time within which the whole body must arrive.
    """

    def __init__(self, app: ASGIApp, maximum_bytes: int, seconds: float) -> None:
        self._app = app
        self._maximum_bytes = maximum_bytes
        self._seconds = seconds

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request; see the ASGI specification for the arguments.

        Parameters
        ----------
        scope : Scope
        receive : Receive
        send : Send
        """
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        received = 0
        complete = False
        start = asyncio.get_running_loop().time()

        async def receive_limited() -> Message:
            nonlocal received, complete
            if complete:  # the next message is the client's disconnect, which may come much later
                return await receive()
            self._check(int(Headers(scope=scope).get("content-length", "0")))
            try:
                async with asyncio.timeout_at(start + self._seconds):
                    message = await receive()
            except TimeoutError:
                raise HTTPException(
                    HTTPStatus.REQUEST_TIMEOUT, f"body: must arrive within {self._seconds:g} s"
                ) from None
            received += len(message.get("body", b""))
            self._check(received)
            complete = not message.get("more_body", False)
            return message

        await self._app(scope, receive_limited, send)

    def _check(self, size: int) -> None:
        if size > self._maximum_bytes:
            raise HTTPException(
                HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
                f"body: {size} bytes — must be at most {self._maximum_bytes}",
            )


class StoppedRequests:
    """Answer the requests that are not finished when the server stops: they may be sent again.

    Parameters
    ----------
    app : ASGIApp
        The application that may be stopped.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request; see the ASGI specification for the arguments.

        Parameters
        ----------
        scope : Scope
        receive : Receive
        send : Send
        """
        has_begun = False

        async def send_noted(message: Message) -> None:
            nonlocal has_begun
            has_begun = True
            await send(message)

        try:
            await self._app(scope, receive, send_noted)
        except asyncio.CancelledError:
            if has_begun or scope["type"] != "http":
                raise
            await problem_response(unavailable("the server stops"))(scope, receive, send)


class Pieces:
    """Send a long body in pieces, and each piece only when the client has read enough of the earlier ones.

    So the server's limit for the time in which a client reads holds for each piece.

    Parameters
    ----------
    app : ASGIApp
        The application whose answers are sent so.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request; see the ASGI specification for the arguments.

        Parameters
        ----------
        scope : Scope
        receive : Receive
        send : Send
        """

        async def send_pieces(message: Message) -> None:
            body = message.get("body", b"")
            if len(body) <= PIECE_BYTES:
                await send(message)
                return
            rest = memoryview(body)
            while len(rest) > PIECE_BYTES:
                await send({**message, "body": bytes(rest[:PIECE_BYTES]), "more_body": True})
                rest = rest[PIECE_BYTES:]
            await send({**message, "body": bytes(rest)})

        await self._app(scope, receive, send_pieces)


class SecurityHeaders:
    """Add `SECURITY_HEADERS` to every answer, except those that the route has set itself.

    Parameters
    ----------
    app : ASGIApp
        The application whose answers get the headers.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request; see the ASGI specification for the arguments.

        Parameters
        ----------
        scope : Scope
        receive : Receive
        send : Send
        """

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                present = {name for name, _ in message["headers"]}  # the web page has its own policy
                message["headers"] = [
                    *message["headers"],
                    *(header for header in ENCODED_HEADERS if header[0] not in present),
                ]
            await send(message)

        await self._app(scope, receive, send_with_headers)


class RequestMetrics:
    """Count requests by method, route and status, and measure the time to the start of each answer.

    Parameters
    ----------
    app : ASGIApp
        The application to measure.
    registry : CollectorRegistry
        Where the metrics are registered.
    """

    def __init__(self, app: ASGIApp, registry: CollectorRegistry) -> None:
        self._app = app
        self._requests = Counter(
            "ensemble_requests", "Requests answered.", ("method", "route", "status"), registry=registry
        )
        self._seconds = Histogram(
            "ensemble_request_seconds",
            "Time to the start of the answer.",
            ("method", "route"),
            registry=registry,
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request; see the ASGI specification for the arguments.

        Parameters
        ----------
        scope : Scope
        receive : Receive
        send : Send
        """
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        start = time.perf_counter()

        async def send_counted(message: Message) -> None:
            if message["type"] == "http.response.start":
                route = getattr(scope.get("route"), "path", UNKNOWN_ROUTE)
                self._requests.labels(scope["method"], route, message["status"]).inc()
                self._seconds.labels(scope["method"], route).observe(time.perf_counter() - start)
            await send(message)

        await self._app(scope, receive, send_counted)
