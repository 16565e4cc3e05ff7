"""The server process: the application under uvicorn, with worker processes beside it."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import logging
import math
import signal
import subprocess
import sys
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractAsyncContextManager, ExitStack, asynccontextmanager, contextmanager
from typing import NoReturn

import uvicorn
from anyio import to_thread
from cachetools import TTLCache
from fastapi import FastAPI

from api.app import create_app
from api.auth.authentication import Authentication, is_loopback
from api.auth.tokens import Tokens
from api.database.service_database import Database, look_up_for
from api.http.bounded_protocol import ConnectionLimits, bounded_protocol
from api.http.open_streams import OpenStreams
from api.http.rate_limits import RateLimits
from api.jobs.expected_times import ExpectedTimes
from api.jobs.job_queue import Jobs
from api.jobs.submissions import Submissions, job_limits
from api.results.downloads import Downloads
from api.routes.service import Service
from api.settings import Settings
from api.worker.launchers import LAUNCHERS
from ensemble.config.documents import preset_names
from ensemble.errors import BadInput
from ensemble.questions import preset_question
from ensemble.store import Store
from ensemble.store.sql_database import Place

WATCHED_JOBS = 1024  # jobs whose state is shared among the clients that listen to events
THREADS = 8  # for reading and writing; more threads would only wait for each other
RESTART_SECONDS = 1.0  # least time between two starts of a worker
STOP_SECONDS = 10.0  # for a worker to end the processes of its job
DRAIN_SECONDS = 3  # for open requests to be answered when the server stops

log = logging.getLogger("uvicorn.error")


def serve(settings: Settings, host: str, port: int, workers: int) -> None:
    """Run the server and its workers until a signal stops it.

    Parameters
    ----------
    settings : Settings
    host : str
        Address to listen at.
    port : int
        Port to listen at; 0 takes a free one.
    workers : int
        Number of worker processes beside the server.

    Raises
    ------
    BadInput
        If the store, the database or the launcher of jobs cannot be used, or if other machines reach the
        address and there are no tokens.
    """
    if workers:
        LAUNCHERS[settings.launcher](settings)
    with open_service(settings) as service:
        if not service.tokens.have_existed() and not is_loopback(host):
            raise BadInput(
                f"host: other machines reach {host}, which needs tokens, and there are none; "
                "make one with `ensemble token create`"
            )
        app = create_app(service, lifespan=_with_workers(service, workers))
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, _end)
        uvicorn.Server(server_configuration(app, settings, host, port)).run()


def _end(*_: object) -> NoReturn:
    """End the process, before the server takes signals or when it has shut down and raises them again."""
    log.info("Stopped; jobs that wait or have begun go on when the service is started again.")
    raise SystemExit(0)


@contextmanager
def open_service(settings: Settings) -> Iterator[Service]:
    """Open the parts of a service.

    Parameters
    ----------
    settings : Settings

    Yields
    ------
    Service

    Raises
    ------
    BadInput
        If the store or the database cannot be used.
    """
    with ExitStack() as stack:
        store = stack.enter_context(Store.open(settings.store))
        database = stack.enter_context(Database.open(settings.database_url, store.path))
        look_up = look_up_for([settings.database_url, Place.of(store.path).url])
        tokens = Tokens(database)
        limits = RateLimits(settings.request_rate, settings.submission_rate, settings.refusal_rate)
        yield Service(
            settings=settings,
            store=store,
            jobs=Jobs(database, store.path),
            submissions=Submissions(job_limits(settings)),
            expected_times=ExpectedTimes(store),
            downloads=Downloads(store.path, settings.maximum_memory),
            # Kept for less time than a listener waits, so no listener receives an older state than before.
            watched_jobs=TTLCache(WATCHED_JOBS, ttl=settings.event_seconds / 2),
            tokens=tokens,
            limits=limits,
            streams=OpenStreams(settings.event_streams),
            authentication=Authentication(tokens, limits, look_up),
            look_up=look_up,
        )


def server_configuration(app: FastAPI, settings: Settings, host: str, port: int) -> uvicorn.Config:
    """Return the configuration of uvicorn, with the limits for connections.

    Parameters
    ----------
    app : FastAPI
    settings : Settings
    host : str
    port : int

    Returns
    -------
    uvicorn.Config
    """
    return uvicorn.Config(
        app,
        host=host,
        port=port,
        http=bounded_protocol(connection_limits(settings)),
        ws="none",
        access_log=False,
        server_header=False,
        # Clients can send the headers of proxies themselves, so only those of trusted proxies count.
        proxy_headers=bool(settings.proxies),
        forwarded_allow_ips=list(settings.proxies),
        limit_concurrency=settings.connections,
        timeout_keep_alive=math.ceil(settings.idle_seconds) + 1,  # the protocol has an earlier limit
        timeout_graceful_shutdown=DRAIN_SECONDS,
    )


def connection_limits(settings: Settings) -> ConnectionLimits:
    """Return the limits for the phases of a connection.

    Parameters
    ----------
    settings : Settings

    Returns
    -------
    ConnectionLimits
    """
    return ConnectionLimits(
        head_bytes=settings.header_bytes,
        head_seconds=settings.header_seconds,
        body_bytes=settings.body_bytes,
        body_seconds=settings.body_seconds,
        answer_seconds=settings.answer_seconds,
        idle_seconds=settings.idle_seconds,
    )


def _with_workers(service: Service, workers: int) -> Callable[[FastAPI], AbstractAsyncContextManager[None]]:
    """Return the application's lifespan, which runs workers as long as the server runs."""
    command = [sys.executable, "-P", "-m", "ensemble", "worker", "--end-with-input"]
    command += ["--store", str(service.store.path)]

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        if not service.tokens.have_existed():
            log.warning("There are no tokens: everybody who reaches this address may do everything.")
        to_thread.current_default_thread_limiter().total_tokens = THREADS
        tasks = [asyncio.create_task(_keep_worker_running(command)) for _ in range(workers)]
        tasks.append(asyncio.create_task(to_thread.run_sync(_warm_up)))
        try:
            yield
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    return lifespan


def _warm_up() -> None:
    """Check the presets once, and exempt everything loaded so far from garbage collection.

    The first submission would wait for the one, and a full collection takes as long as a hundred requests.
    """
    for name in preset_names():
        preset_question(name, {})
    gc.collect()
    gc.freeze()


async def _keep_worker_running(command: list[str]) -> None:
    """Run a worker, and start another one whenever it ends, until cancelled."""
    clock = asyncio.get_running_loop().time
    while True:
        next_start = clock() + RESTART_SECONDS
        # The worker ends when this pipe closes, so it ends with the server even if the server is killed.
        worker = await asyncio.create_subprocess_exec(*command, stdin=subprocess.PIPE, start_new_session=True)
        try:
            status = await worker.wait()
        except asyncio.CancelledError:
            await _stop_worker(worker)
            raise
        log.error("A worker ended with status %s; starting another one.", status)
        await asyncio.sleep(next_start - clock())


async def _stop_worker(worker: asyncio.subprocess.Process) -> None:
    with contextlib.suppress(ProcessLookupError):
        worker.terminate()
    try:
        await asyncio.wait_for(worker.wait(), STOP_SECONDS)
    except TimeoutError:
        worker.kill()
        await worker.wait()
