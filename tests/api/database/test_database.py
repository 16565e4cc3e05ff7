"""The migrations make the tables that the code declares, and commits are durable."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest
from alembic import command
from alembic.config import Config
from sqlalchemy import delete, inspect, text

from api.database.database_tables import JobRow, ServiceTable
from api.database.service_database import MIGRATIONS, Database
from api.jobs.job_queue import Jobs
from ensemble.errors import BadInput
from ensemble.questions import preset_question
from tests.api.accepting import accepted
from tests.api.processes import run_python

OPENING = """
import sys
from pathlib import Path
from api.database.service_database import Database
Database.open(sys.argv[1], Path(sys.argv[2])).close()
"""

SUBMITTING = """
import os, sys
from pathlib import Path
from api.database.service_database import Database
from ensemble.questions import preset_question
from api.jobs.job_queue import Jobs
jobs = Jobs(Database.open(sys.argv[1], Path(sys.argv[2])), Path(sys.argv[2]))
question = preset_question("doublet-shear", {})
while True:
    # One write, which arrives as a whole or not at all, like an answer over a socket.
    os.write(1, (jobs.result(jobs.submit(question, "ada", 1, 60.0)).job.id + "\\n").encode())
"""


def migrations(connection) -> Config:
    config = Config()
    config.set_main_option("script_location", MIGRATIONS)
    config.attributes["connection"] = connection
    return config


def test_the_migrations_make_the_declared_tables(database):
    with database.begin() as connection:
        command.check(migrations(connection))  # raises where they differ


def test_every_migration_can_be_reverted(database):
    with database.begin() as connection:
        command.downgrade(migrations(connection), "base")
        left = set(inspect(connection).get_table_names())
        assert not left & set(ServiceTable.metadata.tables)
        command.upgrade(migrations(connection), "head")
        command.check(migrations(connection))


def test_processes_that_start_together_make_the_tables_once(database_url, store):
    with ThreadPoolExecutor(3) as pool:
        opened = [pool.submit(run_python, OPENING, database_url, str(store)) for _ in range(3)]
    assert [result.result().returncode for result in opened] == [0] * 3, opened[0].result().stderr


def test_sqlite_syncs_every_commit(store):
    with Database.open(f"sqlite:///{store}/jobs.sqlite", store) as database, database.connect() as connection:
        assert connection.scalar(text("PRAGMA journal_mode")) == "wal"
        assert connection.scalar(text("PRAGMA synchronous")) == 2, "2 is FULL"


def test_accepted_jobs_survive_a_kill(database_url, store):
    command = [sys.executable, "-c", SUBMITTING, database_url, str(store)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as submitting:
        acknowledged = [submitting.stdout.readline().strip() for _ in range(20)]
        os.kill(submitting.pid, signal.SIGKILL)
        acknowledged += submitting.stdout.read().split()
    with Database.open(database_url, store) as database:
        kept = [job.id for job in Jobs(database, store).latest(10_000)]
    assert len(acknowledged) >= 20
    assert acknowledged == kept[::-1][: len(acknowledged)]
    assert len(kept) <= len(acknowledged) + 1, "one at most was committed and not acknowledged"


@pytest.mark.parametrize(
    "url",
    [
        "nonsense",
        "nodatabase://here",
        "sqlite:////no/such/directory/jobs.sqlite",
        "postgresql+psycopg://127.0.0.1:1/x",
    ],
)
def test_a_database_that_cannot_be_used_is_refused_on_one_line(url, store):
    with pytest.raises(BadInput, match=r"^database: .+") as refused:
        Database.open(url, store)
    assert "\n" not in str(refused.value)


def test_a_failing_transaction_is_rolled_back(database, jobs):
    kept = accepted(jobs, preset_question("doublet-shear", {}), "ada", 1, 60.0).job

    def change_and_fail() -> None:
        with database.begin() as connection:
            connection.execute(delete(JobRow))
            raise RuntimeError

    with pytest.raises(RuntimeError):
        change_and_fail()
    assert jobs.get(kept.id) == kept
