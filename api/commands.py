"""The commands `serve`, `worker` and `token` of the command line.

Each imports what it needs when it is called, as the commands of `ensemble.cli` do.
"""

from __future__ import annotations

from datetime import timedelta
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from api.auth import TokenScope
from ensemble.cli.options import StorePath
from ensemble.config.defaults import DEFAULT_STORE
from ensemble.errors import BadInput

if TYPE_CHECKING:
    from api.settings import Settings


class TokenAction(StrEnum):
    """What the command `token` does."""

    CREATE = "create"
    LIST = "list"
    REVOKE = "revoke"


def serve(  # numpydoc ignore=PR01
    host: Annotated[str, typer.Option(help="Address to listen at.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen at; 0: a free one.")] = 8000,
    store: StorePath = DEFAULT_STORE,
    workers: Annotated[int, typer.Option(min=0, help="Worker processes to run beside the server.")] = 1,
) -> None:
    """Serve jobs, runs and boundaries over HTTP, with a web page to look at them."""
    import api.serve

    api.serve.serve(_settings(store), host, port, workers)


def worker(  # numpydoc ignore=PR01
    store: StorePath = DEFAULT_STORE,
    end_with_input: Annotated[
        bool, typer.Option("--end-with-input", help="Stop when standard input is closed.")
    ] = False,
) -> None:
    """Carry out jobs one after the other. Several workers may share a store.

    When a worker ends, whatever the reason, the processes of its job end as well, and another worker
    continues the job.
    """
    import logging
    import signal
    import sys
    import threading

    from api.database.service_database import Database
    from api.jobs.job_queue import Jobs
    from api.worker.launchers import LAUNCHERS
    from api.worker.worker import Worker
    from ensemble.store import Store

    logging.basicConfig(format="%(asctime)s %(message)s")
    logging.getLogger("api").setLevel(logging.INFO)
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())

    def wait_for_end_of_input() -> None:
        sys.stdin.read()
        stop.set()

    if end_with_input:
        threading.Thread(target=wait_for_end_of_input, daemon=True).start()
    settings = _settings(store)
    launcher = LAUNCHERS[settings.launcher](settings)
    with Store.open(store) as opened, Database.open(settings.database_url, opened.path) as database:
        Worker(Jobs(database, opened.path), opened, settings.maximum_memory, launcher).run(stop)


def token(  # numpydoc ignore=PR01
    action: Annotated[TokenAction, typer.Argument(help="What to do.")],
    name: Annotated[
        str,
        typer.Argument(metavar="[USER|ID]", help="User to create a token for, or id of the token to revoke."),
    ] = "",
    scope: Annotated[TokenScope, typer.Option(help="What the token allows.")] = TokenScope.SUBMIT,
    days: Annotated[float, typer.Option(min=0.0, max=3650.0, help="Days until it expires.")] = 90.0,
    store: StorePath = DEFAULT_STORE,
) -> None:
    """Create a bearer token (it is shown only this once), list all tokens, or revoke one."""
    from rich.console import Console

    from api.auth.tokens import Tokens, tokens_table
    from api.database.service_database import Database
    from ensemble.store import Store

    settings = _settings(store)
    with Store.open(store) as opened, Database.open(settings.database_url, opened.path) as database:
        tokens = Tokens(database)
        if action is TokenAction.LIST:
            Console().print(tokens_table(tokens.all()))
        elif action is TokenAction.CREATE:
            print(tokens.create(name, scope, timedelta(days=days)))
        else:
            tokens.revoke(name)


def _settings(store: Path) -> Settings:
    from pydantic import ValidationError

    from api.settings import Settings
    from ensemble.config.checkpoint_interval import checkpoint_seconds

    checkpoint_seconds()  # the jobs of a worker take it from its environment
    try:
        return Settings(store=store)
    except ValidationError as error:
        (first, *_) = error.errors()
        variable = "_".join(str(part) for part in ("ENSEMBLE", *first["loc"])).upper()
        raise BadInput(f"{variable}: {first['msg']}") from error
