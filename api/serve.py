"""The server: the application under uvicorn, with workers beside it."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import logging
import subprocess
import sys
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractAsyncContextManager, ExitStack, asynccontextmanager, contextmanager

import uvicorn
from anyio import to_thread
from cachetools import TTLCache
from fastapi import FastAPI

from api.app import create_app
from api.auth.callers import is_loopback
from api.auth.tokens import Tokens
from api.database.service_database import Database
from api.http.protocol import impatient
from api.http.rate_limits import RateLimits
from api.http.service import Service
from api.jobs.job import preset_work
from api.jobs.job_queue import Jobs
from api.jobs.submissions import Submissions
from api.settings import Settings
from ensemble.config.documents import preset_names
from ensemble.errors import BadInput
from ensemble.store import Store
from ensemble.store.sql_database import Place, is_file

MOST_WATCHED = 1024  # jobs that are looked at together by those who listen
THREADS = 8  # that read and write; more of them would only wait for each other
RESTART_SECONDS = 1.0  # between two starts of a worker that ends at once
STOP_SECONDS = 10.0  # that a worker has to end its job's processes
DRAIN_SECONDS = 3  # that requests have to be answered when the server ends

log = logging.getLogger("uvicorn.error")


def serve(settings: Settings, host: str, port: int, workers: int) -> None:
    """Serve until told to stop, with as many workers beside the server.

    Raises
    ------
    BadInput
        If the store or the database cannot be used, or the address is reached from elsewhere and there are
        no tokens.
    """
    with opened(settings) as service:
        if not service.needs_tokens and not is_loopback(host):
            raise BadInput(
                f"host: {host} can be reached from elsewhere, which needs tokens and there are none; "
                "make one with `ensemble token create`"
            )
        app = create_app(service, lifespan=_beside_workers(service, workers))
        uvicorn.Server(configuration(app, settings, host, port)).run()


@contextmanager
def opened(settings: Settings) -> Iterator[Service]:
    """Open what a service needs; it asks for tokens if there are any, whether or not they have expired."""
    with ExitStack() as stack:
        store = stack.enter_context(Store.open(settings.store))
        database = stack.enter_context(Database.open(settings.database_url, store.path))
        tokens = Tokens(database)
        yield Service(
            settings=settings,
            store=store,
            jobs=Jobs(database, store.path),
            submissions=Submissions(settings.maximum_cost),
            # Kept for less time than a listener waits: nobody is sent an older state than the one before.
            watched=TTLCache(MOST_WATCHED, ttl=settings.event_seconds / 2),
            tokens=tokens,
            limits=RateLimits(settings.request_rate, settings.refusal_rate),
            needs_tokens=bool(tokens.all()),
            embedded=all(is_file(url) for url in (settings.database_url, Place.of(store.path).url)),
        )


def configuration(app: FastAPI, settings: Settings, host: str, port: int) -> uvicorn.Config:
    """Say how the server treats its clients."""
    return uvicorn.Config(
        app,
        host=host,
        port=port,
        http=impatient(settings.header_bytes, settings.header_seconds),
        ws="none",
        access_log=False,
        server_header=False,
        # A client may write what it likes into the headers that proxies use.
        proxy_headers=False,
        limit_concurrency=settings.connections,
        timeout_graceful_shutdown=DRAIN_SECONDS,
    )


def _beside_workers(service: Service, workers: int) -> Callable[[FastAPI], AbstractAsyncContextManager[None]]:
    command = [sys.executable, "-P", "-m", "ensemble", "worker", "--end-with-input"]
    command += ["--store", str(service.store.path)]

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        if not service.needs_tokens:
            log.warning("There are no tokens: whoever reaches this address may do everything.")
        to_thread.current_default_thread_limiter().total_tokens = THREADS
        tasks = [asyncio.create_task(_keep_running(command)) for _ in range(workers)]
        tasks.append(asyncio.create_task(to_thread.run_sync(_warm_up)))
        try:
            yield
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    return lifespan


def _warm_up() -> None:
    """Do beforehand what the first submission would wait for, and then have the collector leave it alone.

    To look through all that a server has loaded takes the collector longer than a hundred requests.
    """
    for name in preset_names():
        preset_work(name, {})
    gc.collect()
    gc.freeze()


async def _keep_running(command: list[str]) -> None:
    """Run a worker, and another one whenever it ends, until cancelled."""
    clock = asyncio.get_running_loop().time
    while True:
        next_start = clock() + RESTART_SECONDS
        # Its end of the pipe tells a worker that the server is gone, however it went.
        worker = await asyncio.create_subprocess_exec(*command, stdin=subprocess.PIPE, start_new_session=True)
        try:
            status = await worker.wait()
        except asyncio.CancelledError:
            await _stop(worker)
            raise
        log.error("A worker ended with status %s; starting another one.", status)
        await asyncio.sleep(next_start - clock())


async def _stop(worker: asyncio.subprocess.Process) -> None:
    with contextlib.suppress(ProcessLookupError):
        worker.terminate()
    try:
        await asyncio.wait_for(worker.wait(), STOP_SECONDS)
    except TimeoutError:
        worker.kill()
        await worker.wait()
