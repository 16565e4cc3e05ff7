"""Jobs of the service that a worker hands to a real Slurm."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from api.database.service_database import Database
from api.jobs.job import Job, JobStatus
from api.jobs.job_queue import Jobs
from api.settings import Settings
from ensemble.questions import Question, preset_question
from ensemble.store import Store
from ensemble.store.checkpoint import checkpointed_keys
from tests.api.accepting import accepted
from tests.api.processes import wait_until, working
from tests.slurm import Cluster

pytestmark = pytest.mark.long  # each starts ranks, and waits for Slurm: 5 to 15 s of processor time

COARSE = {"numerics.points": 32, "numerics.tolerance": 1e-3}
ENDLESS_SCENE = preset_question("doublet-shear", COARSE | {"horizon": 1e5, "criteria.revolutions": 10**5})
STUDY = preset_question(
    "critical-hamaker",
    {f"scene.{path}": value for path, value in COARSE.items()}
    | {"search.tolerance": 0.2, "sweep.values": [0.5, 1.0]},
)


@pytest.fixture
def cluster(slurm_cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> Cluster:
    """A cluster that workers submit to."""
    monkeypatch.setenv("ENSEMBLE_LAUNCHER", "slurm")
    for name, value in slurm_cluster.variables.items():
        monkeypatch.setenv(name, value)
    return slurm_cluster


@pytest.fixture
def jobs(store: Path) -> Iterator[Jobs]:
    with Database.open(Settings(store=store).database_url, store) as database:
        yield Jobs(database, store)


def submit(jobs: Jobs, question: Question, ranks: int = 1, seconds: float = 3600.0) -> Job:
    return accepted(jobs, question, "ada", ranks, seconds).job


def has(jobs: Jobs, job: Job, *statuses: JobStatus) -> Callable[[], bool]:
    return lambda: jobs.get(job.id).status in statuses


def simulating(jobs: Jobs, job: Job) -> Callable[[], bool]:
    return lambda: jobs.get(job.id).progress > 0


def assert_nothing_is_left(cluster: Cluster, jobs: Jobs, job: Job) -> None:
    wait_until(lambda: cluster.jobs() == [])
    log = jobs.log_path(job)
    assert {path.suffix for path in log.parent.glob(f"{job.id}*")} <= {log.suffix, ".toml"}


def test_a_study_is_traced_by_a_job_of_the_cluster(cluster: Cluster, jobs: Jobs, store: Path) -> None:
    job = submit(jobs, STUDY, ranks=2)
    seen = set()

    def finished() -> bool:
        seen.add(jobs.get(job.id).progress)
        return jobs.get(job.id).status.finished

    with working(store):
        wait_until(finished)
    done = jobs.get(job.id)
    assert (done.status, done.message) == (JobStatus.SUCCEEDED, "2 of 2 points converged")
    assert done.attempts == 1
    assert any(0 < progress < 100 for progress in seen)
    assert "of Slurm" in jobs.log_path(job).read_text()
    assert_nothing_is_left(cluster, jobs, job)
    with Store.existing(store) as opened:
        assert opened.check() == []


def test_a_dismissed_job_leaves_the_cluster(cluster: Cluster, jobs: Jobs, store: Path) -> None:
    job = submit(jobs, ENDLESS_SCENE)
    with working(store):
        wait_until(simulating(jobs, job))
        jobs.dismiss(job.id)
        assert_nothing_is_left(cluster, jobs, job)


def test_a_job_ends_at_its_time_limit_there(cluster: Cluster, jobs: Jobs, store: Path) -> None:
    job = submit(jobs, ENDLESS_SCENE, seconds=3.0)
    with working(store):
        wait_until(has(jobs, job, JobStatus.FAILED))
        assert jobs.get(job.id).message == "stopped at its time limit, 3 s"
        assert_nothing_is_left(cluster, jobs, job)


def test_a_stopped_worker_gives_its_job_back_with_a_checkpoint(
    cluster: Cluster, jobs: Jobs, store: Path
) -> None:
    job = submit(jobs, ENDLESS_SCENE)
    with working(store) as family:
        wait_until(simulating(jobs, job))
        family.worker.send_signal(signal.SIGTERM)
        wait_until(has(jobs, job, JobStatus.ACCEPTED))
    assert_nothing_is_left(cluster, jobs, job)
    assert len(set(checkpointed_keys(store))) == 1


def test_what_a_killed_worker_left_ends_and_another_worker_goes_on(
    cluster: Cluster, jobs: Jobs, store: Path
) -> None:
    job = submit(jobs, ENDLESS_SCENE)
    with working(store) as family:
        wait_until(simulating(jobs, job))
        (first,) = cluster.jobs()
        family.worker.kill()
        with working(store):
            wait_until(lambda: jobs.get(job.id).attempts == 2)
            wait_until(lambda: first not in cluster.jobs() and len(cluster.jobs()) == 1)
            jobs.dismiss(job.id)
            assert_nothing_is_left(cluster, jobs, job)


def test_a_job_that_nobody_follows_ends_itself(cluster: Cluster, jobs: Jobs, store: Path) -> None:
    job = submit(jobs, ENDLESS_SCENE)
    with working(store) as family:
        wait_until(simulating(jobs, job))
        family.worker.kill()
        wait_until(lambda: cluster.jobs() == [])


def test_a_job_that_is_canceled_on_the_cluster_is_tried_again(
    cluster: Cluster, jobs: Jobs, store: Path
) -> None:
    job = submit(jobs, STUDY)
    with working(store):
        wait_until(simulating(jobs, job))
        cluster.run("scancel", *cluster.jobs())
        wait_until(has(jobs, job, JobStatus.SUCCEEDED))
    assert jobs.get(job.id).attempts == 2
    assert "CANCELLED" in jobs.log_path(job).read_text()
