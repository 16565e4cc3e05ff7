"""A request's body: not too large, and not too slow."""

from __future__ import annotations

import asyncio
from http import HTTPStatus

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send


class BoundedBody:
    """Refuses a body of more than `most_bytes`, announced or sent, or one that takes more than `seconds`.

    It is refused where it is read, so a route that takes none is not concerned.
    """

    def __init__(self, app: ASGIApp, most_bytes: int, seconds: float) -> None:
        self._app = app
        self._most_bytes = most_bytes
        self._seconds = seconds

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        received = 0
        complete = False
        begun = asyncio.get_running_loop().time()

        async def receive_bounded() -> Message:
            nonlocal received, complete
            if complete:  # what follows the body is the client going away, for which a listener waits long
                return await receive()
            self._check(int(Headers(scope=scope).get("content-length", "0")))
            try:
                async with asyncio.timeout_at(begun + self._seconds):
                    message = await receive()
            except TimeoutError:
                raise HTTPException(
                    HTTPStatus.REQUEST_TIMEOUT, f"body: must arrive within {self._seconds:g} s"
                ) from None
            received += len(message.get("body", b""))
            self._check(received)
            complete = not message.get("more_body", False)
            return message

        await self._app(scope, receive_bounded, send)

    def _check(self, size: int) -> None:
        if size > self._most_bytes:
            raise HTTPException(
                HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
                f"body: {size} bytes — must be at most {self._most_bytes}",
            )
