"""Jobs carried out by real workers on real ranks, stopped and killed."""

from __future__ import annotations

import json
import random
import signal
import sqlite3
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import psutil
import pytest

from api.database.service_database import Database
from api.jobs.job import UNFINISHED, Job, JobStatus, Lease
from api.jobs.job_queue import Jobs
from api.settings import Settings
from api.worker.background import NICENESS
from api.worker.delays import growing_delay
from api.worker.launchers.launcher import JobAttempt
from api.worker.launchers.mpirun import Mpirun
from api.worker.worker import ANSWERS, MAXIMUM_CRASHES, JobResult, Worker, job_result
from ensemble.questions import INCOMPLETE_STATUS, Question, preset_question
from ensemble.store import Store
from ensemble.store.checkpoint import checkpoint_path
from tests.api.accepting import accepted
from tests.api.processes import Family, alive, wait_until, working

SECONDS = 3600.0
SEPARATED = json.dumps({"outcome": "separated", "failure": None})
ANSWER = json.dumps({"outcome": "failed", "failure": "underflow"})
# Far less on a machine that has nothing else to do.
SECONDS_TO_DISMISS = 60
SECONDS_TO_DIE = 20

COARSE = {"numerics.points": 32, "numerics.tolerance": 1e-3}
QUICK_SCENE = preset_question("doublet-shear", COARSE | {"criteria.revolutions": 1})
LONG_SCENE = preset_question("doublet-shear", {"numerics.points": 256, "numerics.tolerance": 1e-9})
ENDLESS_SCENE = preset_question("doublet-shear", COARSE | {"horizon": 1e5, "criteria.revolutions": 10**5})
FAILING_SCENE = preset_question("doublet-shear", COARSE | {"numerics.work_limit": 20})
COARSE_STUDY = {f"scene.{path}": value for path, value in COARSE.items()}
STUDY = preset_question(
    "critical-hamaker", COARSE_STUDY | {"search.tolerance": 0.2, "sweep.values": [0.5, 1.0]}
)
UNBRACKETED_STUDY = preset_question(
    "critical-hamaker",
    COARSE_STUDY
    | {
        "sweep.values": [0.5],
        "search.limits": [1.5, 2.5],
        "search.guesses": [{"at": 0.5, "bracket": [1.6, 2.4]}],
        "search.tolerance": 0.3,
    },
)


@pytest.fixture
def jobs(store: Path) -> Iterator[Jobs]:
    """The queue of a store, in the database that its workers use."""
    with Database.open(Settings(store=store).database_url, store) as database:
        yield Jobs(database, store)


def submit(jobs: Jobs, question: Question, ranks: int = 1, seconds: float = SECONDS) -> Job:
    return accepted(jobs, question, "ada", ranks, seconds).job


def finished(jobs: Jobs, job: Job) -> Callable[[], bool]:
    return lambda: jobs.get(job.id).status.finished


def made(store: Path) -> dict[str, str]:
    """Time of creation of every committed run."""
    with Store.existing(store) as opened:
        return {summary.key: summary.created.isoformat() for summary in opened.summaries()}


def simulating(family: Family, ranks: int) -> Callable[[], bool]:
    def all_there() -> bool:
        started = {process.environ().get("PMI_RANK") for process in family.descendants()}
        return {str(number) for number in range(ranks)} <= started

    return all_there


@pytest.mark.long
def test_jobs_are_carried_out_one_after_the_other(jobs, store):
    scene, failing = submit(jobs, QUICK_SCENE), submit(jobs, FAILING_SCENE)
    study, unbracketed = submit(jobs, STUDY, ranks=2), submit(jobs, UNBRACKETED_STUDY)
    progress: dict[str, set[int]] = {job.id: set() for job in (scene, study)}
    with working(store):

        def all_finished() -> bool:
            for name in progress:
                progress[name].add(jobs.get(name).progress)
            return all(jobs.get(job.id).status.finished for job in (scene, failing, study, unbracketed))

        wait_until(all_finished)
    with Store.existing(store) as opened:
        scene_done, study_done = jobs.get(scene.id), jobs.get(study.id)
        assert (scene_done.status, scene_done.message) == (JobStatus.SUCCEEDED, "bound")
        assert opened.summary(scene.key).outcome == "bound"
        assert (study_done.status, study_done.message) == (JobStatus.SUCCEEDED, "2 of 2 points converged")
        (boundary,) = [found for found in opened.boundaries() if found.study_key == study.key]
        assert {point.status for point in boundary.points} == {"converged"}
        assert jobs.get(failing.id).status is JobStatus.FAILED
        assert jobs.get(failing.id).message == opened.summary(failing.key).failure
        assert jobs.get(unbracketed.id).status is JobStatus.FAILED
        message = jobs.get(unbracketed.id).message
        assert message.startswith("0 of 1 points converged; flow.rate 0.5: unbracketed")
        assert opened.check() == []
    for done in (scene_done, study_done):
        assert done.created < done.started < done.finished
        assert (done.progress, done.attempts) == (100, 1)
    assert any(0 < seen < 100 for seen in progress[study.id])
    assert "runs" in jobs.log_path(study).read_text()
    assert "100%" in jobs.log_path(study).read_text()
    assert "time" in jobs.log_path(scene).read_text()


def test_what_is_in_the_store_is_not_run_again(jobs, store):
    with working(store):
        first = submit(jobs, QUICK_SCENE)
        wait_until(finished(jobs, first))
        before = made(store)
        again = submit(jobs, QUICK_SCENE)
        wait_until(finished(jobs, again))
    assert jobs.get(again.id).status is JobStatus.SUCCEEDED
    assert made(store) == before
    assert before.keys() == {first.key}


def test_a_job_ends_at_its_time_limit(jobs, store):
    job = submit(jobs, LONG_SCENE, seconds=1.0)
    with working(store) as family:
        wait_until(finished(jobs, job))
        wait_until(lambda: not family.descendants(), SECONDS_TO_DISMISS)
    assert jobs.get(job.id).status is JobStatus.FAILED
    assert jobs.get(job.id).message == "stopped at its time limit, 1 s"


def gives_way(process: psutil.Process) -> bool:
    weight = Path(f"/proc/{process.pid}/autogroup")  # of its session, where the kernel has such weights
    session_does = not weight.exists() or weight.read_text().split()[-1] == str(NICENESS)
    return process.nice() == NICENESS and session_does


def test_a_dismissed_job_leaves_no_process_and_makes_room(jobs, store):
    job, following = submit(jobs, LONG_SCENE, ranks=2), submit(jobs, QUICK_SCENE)
    with working(store) as family:
        wait_until(simulating(family, 1))
        wait_until(lambda: gives_way(family.rank(0)))
        job_processes = family.descendants()
        assert jobs.dismiss(job.id).status is JobStatus.DISMISSED
        wait_until(lambda: not alive(job_processes), SECONDS_TO_DISMISS)
        wait_until(finished(jobs, following))
    assert jobs.get(job.id).status is JobStatus.DISMISSED
    assert made(store).keys() == {following.key}


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_stopped_worker_gives_its_job_back(jobs, store, number):
    job = submit(jobs, LONG_SCENE)
    with working(store) as family:
        wait_until(simulating(family, 1))
        family.worker.send_signal(number)
        assert family.worker.wait(SECONDS_TO_DISMISS) == 0
        assert family.members() == []
    assert jobs.get(job.id).status is JobStatus.ACCEPTED
    assert jobs.lease("another") is not None, "without waiting for the lease to run out"


def test_a_stopped_worker_keeps_the_run_of_its_job_and_the_next_one_goes_on_with_it(jobs, store):
    job = submit(jobs, ENDLESS_SCENE, ranks=2)
    log = jobs.log_path(job)
    with working(store) as family:
        wait_until(lambda: log.exists() and "time" in log.read_text())
        family.worker.send_signal(signal.SIGTERM)
        assert family.worker.wait(SECONDS_TO_DISMISS) == 0
        assert family.members() == []
    assert checkpoint_path(store, job.key).exists()
    with working(store):
        wait_until(lambda: "goes on from its checkpoint" in log.read_text())


def test_a_worker_ends_with_its_input_if_asked(jobs, store):
    job = submit(jobs, LONG_SCENE)
    with working(store, "--end-with-input") as family:
        wait_until(simulating(family, 1))
        family.worker.stdin.close()
        assert family.worker.wait(SECONDS_TO_DISMISS) == 0
        assert family.members() == []
    assert jobs.get(job.id).status is JobStatus.ACCEPTED


VICTIMS: dict[str, Callable[[Family], psutil.Process]] = {
    "worker": lambda family: psutil.Process(family.worker.pid),
    "watcher": Family.watcher,
    "launcher": Family.launcher,
    "helper": Family.helper,
    "rank 1": lambda family: family.rank(1),
}


@pytest.mark.long
@pytest.mark.parametrize("victim", VICTIMS)
def test_a_kill_leaves_no_process_loses_no_job_and_repeats_no_run(jobs, store, victim):
    job = submit(jobs, STUDY, ranks=2)
    with working(store) as family:
        wait_until(lambda: len(made(store)) >= 2)
        time.sleep(random.Random(victim).uniform(0, 0.5))
        attempt = family.descendants()
        kept = made(store)
        VICTIMS[victim](family).send_signal(signal.SIGKILL)
        wait_until(lambda: not alive(attempt), SECONDS_TO_DIE)
        if victim == "worker":
            assert family.descendants() == []
            assert not jobs.get(job.id).status.finished
            with working(store):
                wait_until(lambda: jobs.get(job.id).attempts == 2)
                wait_until(finished(jobs, job))
        else:
            wait_until(finished(jobs, job))
    done = jobs.get(job.id)
    assert (done.status, done.message) == (JobStatus.SUCCEEDED, "2 of 2 points converged")
    assert done.attempts == 2
    assert kept.items() <= made(store).items(), "a committed run was made again"
    with Store.existing(store) as opened:
        assert opened.check() == []


def leased(jobs: Jobs, name: str = "unlucky") -> Lease:
    lease = jobs.lease(name)
    assert lease is not None
    return lease


def test_a_job_that_has_taken_its_workers_along_is_given_up(jobs, store):
    job = submit(jobs, QUICK_SCENE)
    for _ in range(MAXIMUM_CRASHES):
        jobs.give_back(leased(jobs).crashed(), "cut short")
    with working(store):
        wait_until(finished(jobs, job))
    assert jobs.get(job.id).status is JobStatus.FAILED
    assert f"{MAXIMUM_CRASHES} attempts ended at the same point" in jobs.get(job.id).message


@contextmanager
def locked_catalog(store: Path) -> Iterator[None]:
    """Keep everybody else from reading the catalog."""
    with closing(sqlite3.connect(store / "catalog.sqlite", isolation_level=None)) as connection:
        connection.execute("BEGIN EXCLUSIVE")
        yield


class Shell:
    """A launcher that has every job carried out by a piece of shell script."""

    limits_time = False

    def __init__(self) -> None:
        self.script = ""

    def command(self, attempt: JobAttempt) -> list[str]:
        return ["/bin/sh", "-c", self.script]

    def end(self, attempt: JobAttempt) -> None:
        pass


@pytest.fixture
def shell() -> Shell:
    return Shell()


@pytest.fixture
def worker(jobs: Jobs, store: Path, shell: Shell) -> Iterator[tuple[Worker, threading.Event]]:
    """A worker in this process, and what stops it."""
    with Store.open(store) as opened:
        yield Worker(jobs, opened, 1 << 32, shell), threading.Event()


@pytest.fixture
def command(shell: Shell) -> Callable[[str], None]:
    """Let jobs be carried out by a piece of shell script."""

    def use(script: str) -> None:
        shell.script = script

    return use


CRASHES = {
    "an error that is told": ("echo 'ensemble: the database cannot be used' >&2; exit 1", "with status 1"),
    "what was accepted and is refused": (
        "echo 'ensemble: store: cannot be opened' >&2; exit 2",
        "with status 2",
    ),
    "an error of MPI": ("echo 'Abort(1) on node 0' >&2; exit 1", "with status 1"),
    "a killed rank": ("kill -9 $$", "by SIGKILL"),
    "a crash in compiled code": ("kill -11 $$", "by SIGSEGV"),
    "success without an answer": ("exit 0", "with status 0"),
    "an answer that is cut short": ('echo \'{"outcome": "bou\'; exit 0', "with status 0"),
    "another document": ("echo '[1]'; exit 0", "with status 0"),
    "an answer and then a failure": (f"echo '{ANSWER}'; exit 1", "with status 1"),
}


@pytest.mark.parametrize("crash", CRASHES)
def test_what_is_no_answer_is_tried_again(jobs, worker, command, monkeypatch, crash):
    script, words = CRASHES[crash]
    works, stop = worker
    waited: list[float] = []

    def delay(tries: int, longest: float) -> float:
        waited.append(growing_delay(tries, longest))
        return 1e-3

    monkeypatch.setattr("api.worker.worker.growing_delay", delay)
    job = submit(jobs, QUICK_SCENE)
    command(script)
    thread = threading.Thread(target=works.run, args=(stop,))
    thread.start()
    try:
        wait_until(lambda: jobs.get(job.id).attempts > 2)
        assert jobs.get(job.id).status in UNFINISHED
        command(f"echo '{ANSWER}'; exit {INCOMPLETE_STATUS}")
        wait_until(finished(jobs, job))
    finally:
        stop.set()
        thread.join()
    done = jobs.get(job.id)
    assert (done.status, done.message) == (JobStatus.FAILED, "underflow")
    assert f"attempt 1 ended {words}; tried again" in jobs.log_path(job).read_text()
    assert all(2.0**number / 2 <= seconds <= 2.0**number for number, seconds in enumerate(waited))


PROGRESS = (
    "n=$(cat %s || echo 0); n=$((n + 1)); echo $n >%s;"
    ' echo "{\\"fraction\\": 0.5, \\"message\\": \\"half\\", \\"reached\\": $n}" >&2; exit 75'
)


@pytest.mark.parametrize("advances", [True, False])
def test_a_job_that_was_asked_to_end_is_never_given_up_and_waits_if_it_came_no_further(
    jobs, worker, command, monkeypatch, tmp_path, advances
):
    works, stop = worker
    waited: list[int] = []
    monkeypatch.setattr("api.worker.worker.growing_delay", lambda tries, _: waited.append(tries) or 1e-3)
    job = submit(jobs, QUICK_SCENE)
    count = tmp_path / "count"
    command(PROGRESS % (count, count) if advances else "exit 75")
    thread = threading.Thread(target=works.run, args=(stop,))
    thread.start()
    try:
        wait_until(lambda: jobs.get(job.id).attempts > MAXIMUM_CRASHES)
        command(f"echo '{ANSWER}'; exit {INCOMPLETE_STATUS}")
        wait_until(finished(jobs, job))
    finally:
        stop.set()
        thread.join()
    assert jobs.get(job.id).message == "underflow"
    attempts = jobs.get(job.id).attempts
    assert waited == ([] if advances else list(range(1, attempts)))


def test_a_job_that_always_crashes_fails_with_the_end_of_its_log(jobs, worker, command, monkeypatch):
    works, stop = worker
    monkeypatch.setattr("api.worker.worker.growing_delay", lambda *_: 1e-3)
    job = submit(jobs, QUICK_SCENE)
    command("echo 'terminate called after throwing an instance' >&2; kill -6 $$")
    thread = threading.Thread(target=works.run, args=(stop,))
    thread.start()
    try:
        wait_until(finished(jobs, job))
    finally:
        stop.set()
        thread.join()
    done = jobs.get(job.id)
    assert done.status is JobStatus.FAILED
    assert done.attempts == MAXIMUM_CRASHES
    assert "terminate called" in done.message
    assert "by SIGABRT" in done.message


def test_outages_however_many_cost_no_job(jobs, worker, command, store, monkeypatch):
    works, stop = worker
    waited: list[int] = []
    monkeypatch.setattr("api.worker.worker.growing_delay", lambda tries, _: waited.append(tries) or 1e-3)
    monkeypatch.setattr("api.worker.worker.HEARTBEAT_SECONDS", 0.02)
    job = submit(jobs, QUICK_SCENE)
    catalog, elsewhere = store / "catalog.sqlite", store.with_name("elsewhere")
    command(f"mv {catalog} {elsewhere}; sleep 0.3; mv {elsewhere} {catalog}; exit 2")
    thread = threading.Thread(target=works.run, args=(stop,))
    thread.start()
    try:
        wait_until(lambda: jobs.get(job.id).attempts > MAXIMUM_CRASHES + 1)
        command(f"echo '{SEPARATED}'")
        wait_until(finished(jobs, job))
    finally:
        stop.set()
        thread.join()
    assert jobs.get(job.id).status is JobStatus.SUCCEEDED
    assert "attempt 1 ended with status 2 in an outage; tried again" in jobs.log_path(job).read_text()
    assert max(waited) > MAXIMUM_CRASHES  # the job itself may be what fills the disk


def test_a_job_that_needs_more_memory_than_it_may_have_says_so(launcher, tmp_path):
    large = ("--set=numerics.points=1024", "--set=vesicles.viscosity_contrast=4.0")
    arguments = ["run", "doublet-shear", *large, "--no-store", "--json"]
    command = Mpirun().command(JobAttempt("a", 1, 300_000_000, SECONDS, arguments, tmp_path / "log"))
    ended = subprocess.run(command, env=launcher.environment, capture_output=True, text=True, check=False)
    assert ended.returncode not in ANSWERS
    assert "ensemble: there is not enough memory" in ended.stderr


@pytest.mark.long
def test_a_locked_catalog_costs_no_job(jobs, store):
    job = submit(jobs, QUICK_SCENE)
    with working(store) as family:
        wait_until(simulating(family, 1))
        with locked_catalog(store):
            wait_until(lambda: not family.descendants(), SECONDS_TO_DISMISS * 3)
        wait_until(finished(jobs, job))
    assert jobs.get(job.id).status is JobStatus.SUCCEEDED
    with Store.existing(store) as opened:
        assert opened.check() == []


@pytest.mark.parametrize(
    ("status", "output", "expected"),
    [
        (INCOMPLETE_STATUS, ANSWER, JobResult(JobStatus.FAILED, "underflow")),
        (
            0,
            json.dumps({"outcome": "separated", "failure": None}),
            JobResult(JobStatus.SUCCEEDED, "separated"),
        ),
        (1, ANSWER, None),
        (2, "", None),
        (INCOMPLETE_STATUS, "", None),
        (INCOMPLETE_STATUS | 1, ANSWER, None),
    ],
)
def test_how_a_job_has_ended(status, output, expected):
    assert job_result("scene", status, output) == expected
