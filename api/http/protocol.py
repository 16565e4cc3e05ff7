"""HTTP for clients that nobody has to trust: the head of a request is neither endless nor slow."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

_END_OF_HEAD = b"\r\n\r\n"


class ImpatientProtocol(HttpToolsProtocol):
    """Closes a connection whose request has no complete head in time, or one that is too large.

    Nothing else bounds how long, or for how much, the server waits for one.  A class made by `impatient` has
    the bounds.
    """

    head_bytes: int
    head_seconds: float

    _head_timer: asyncio.TimerHandle | None = None
    _head_received = 0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for a request."""
        super().connection_made(transport)
        self._expect_head()

    def on_message_begin(self) -> None:
        """Begin to wait for the rest of a head, unless that has begun with the connection."""
        super().on_message_begin()
        if self._head_timer is None:
            self._expect_head()

    def data_received(self, data: bytes) -> None:
        """Take bytes of a request."""
        # A head that ends in these bytes is over once they are parsed, so it is measured before.
        ending = max(data.find(_END_OF_HEAD), 0)
        if self._head_timer is not None and self._head_received + ending > self.head_bytes:
            self._give_up()
            return
        super().data_received(data)
        if self._head_timer is not None:
            self._head_received += len(data)
            if self._head_received > self.head_bytes:
                self._give_up()

    def on_headers_complete(self) -> None:
        """Wait no longer."""
        self._stop_waiting()
        super().on_headers_complete()

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait no longer."""
        self._stop_waiting()
        super().connection_lost(exc)

    def _expect_head(self) -> None:
        self._head_timer = self.loop.call_later(self.head_seconds, self._give_up)

    def _stop_waiting(self) -> None:
        if self._head_timer is not None:
            self._head_timer.cancel()
            self._head_timer = None
            self._head_received = 0

    def _give_up(self) -> None:
        if not self.transport.is_closing():
            self.send_400_response("The head of the request is too large or too slow.")


def impatient(head_bytes: int, head_seconds: float) -> type[ImpatientProtocol]:
    """Make the protocol with these bounds."""
    bounds: dict[str, Any] = {"head_bytes": head_bytes, "head_seconds": head_seconds}
    return type("BoundedProtocol", (ImpatientProtocol,), bounds)
