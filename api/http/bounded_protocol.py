"""HTTP/1.1 with limits on the head of a request, against clients that send slowly or without end."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

_END_OF_HEAD = b"\r\n\r\n"


class BoundedProtocol(HttpToolsProtocol):
    """Close a connection if the head of a request is too large or incomplete after a time limit.

    The head is the request line and the headers. Uvicorn itself has no such limits. Use
    `bounded_protocol`, which makes a subclass with the two limits.
    """

    head_bytes: int
    head_seconds: float

    _head_timer: asyncio.TimerHandle | None = None
    _head_received = 0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the time limit for the first request; see `asyncio.Protocol`.

        Parameters
        ----------
        transport : asyncio.Transport
        """
        super().connection_made(transport)
        self._expect_head()

    def on_message_begin(self) -> None:
        """Start the time limit for a further request on the same connection."""
        super().on_message_begin()
        if self._head_timer is None:
            self._expect_head()

    def data_received(self, data: bytes) -> None:
        """Check the size of the head and parse the data; see `asyncio.Protocol`.

        Parameters
        ----------
        data : bytes
        """
        # Parsing a complete head stops the timer, so a head that ends in this data is measured before.
        remaining_head = max(data.find(_END_OF_HEAD), 0)
        if self._head_timer is not None and self._head_received + remaining_head > self.head_bytes:
            self._refuse()
            return
        super().data_received(data)
        if self._head_timer is not None:
            self._head_received += len(data)
            if self._head_received > self.head_bytes:
                self._refuse()

    def on_headers_complete(self) -> None:
        """Stop the time limit: the head is complete."""
        self._stop_timer()
        super().on_headers_complete()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the time limit: the connection is closed; see `asyncio.Protocol`.

        Parameters
        ----------
        exc : Exception or None
        """
        self._stop_timer()
        super().connection_lost(exc)

    def _expect_head(self) -> None:
        self._head_timer = self.loop.call_later(self.head_seconds, self._refuse)

    def _stop_timer(self) -> None:
        if self._head_timer is not None:
            self._head_timer.cancel()
            self._head_timer = None
            self._head_received = 0

    def _refuse(self) -> None:
        if not self.transport.is_closing():
            self.send_400_response("The head of the request is too large or too slow.")


def bounded_protocol(head_bytes: int, head_seconds: float) -> type[BoundedProtocol]:
    """Return a protocol class for uvicorn with these limits.

    Parameters
    ----------
    head_bytes : int
        Largest size of a request line with its headers.
    head_seconds : float
        Time within which a head must arrive, from the start of the connection or of the request.

    Returns
    -------
    type
    """
    limits: dict[str, Any] = {"head_bytes": head_bytes, "head_seconds": head_seconds}
    return type("LimitedProtocol", (BoundedProtocol,), limits)
