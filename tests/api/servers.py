"""Services to send requests to: the application under its real server, in a thread of the test's process."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import Any

import httpx2
import uvicorn
from fastapi import APIRouter

from api.app import COMMON_PROBLEMS, create_app
from api.auth import TokenScope
from api.auth.tokens import Tokens
from api.database.service_database import Database
from api.serve import open_service, server_configuration
from api.settings import Settings

SECONDS_TO_START = 120


def make_token(store: Path, user: str, scope: TokenScope, lifetime: timedelta = timedelta(hours=1)) -> str:
    """Make a token in the database of a store."""
    with Database.open(Settings(store=store).database_url, store) as database:
        return Tokens(database).create(user, scope, lifetime)


@contextmanager
def serving(store: Path, routers: Iterable[APIRouter] = (), **limits: Any) -> Iterator[str]:
    """Serve a store, without workers and perhaps with additional routes; gives the address."""
    settings = Settings(store=store, **limits)
    with open_service(settings) as service:
        app = create_app(service)
        for router in routers:
            app.include_router(router, responses=COMMON_PROBLEMS)
        server = uvicorn.Server(server_configuration(app, settings, "127.0.0.1", 0))
        thread = threading.Thread(target=server.run)
        thread.start()
        try:
            yield f"http://127.0.0.1:{_port(server, thread)}"
        finally:
            server.should_exit = True
            thread.join()


def _port(server: uvicorn.Server, thread: threading.Thread) -> int:
    deadline = time.monotonic() + SECONDS_TO_START
    while not server.started:
        assert thread.is_alive()
        assert time.monotonic() < deadline, "the server did not start"
        time.sleep(0.01)
    (socket,) = server.servers[0].sockets
    return int(socket.getsockname()[1])


@contextmanager
def client_of(
    store: Path, token: str | None = None, routers: Iterable[APIRouter] = (), **limits: Any
) -> Iterator[httpx2.Client]:
    """Serve a store and give a client of this service."""
    headers = {} if token is None else {"Authorization": f"Bearer {token}"}
    with (
        serving(store, routers, **limits) as address,
        httpx2.Client(base_url=address, headers=headers, timeout=30) as client,
    ):
        yield client
