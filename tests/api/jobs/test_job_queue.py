"""The queue: nothing is accepted twice, nobody waits for ever, nobody writes who has lost the right to."""

from __future__ import annotations

import itertools
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from api.database.service_database import Database
from api.jobs.job import (
    IdempotencyConflict,
    Job,
    JobStatus,
    Lease,
    NoSuchJob,
    TooManyJobs,
)
from api.jobs.job_queue import LEASE_SECONDS, Jobs
from api.jobs.worker_identity import own_identity
from ensemble.config.documents import load_scene, load_study
from ensemble.config.run_key import run_key
from ensemble.questions import Question, kind_of_model, preset_question
from tests.api.accepting import accepted

SCENE = preset_question("doublet-shear", {})
OTHER_SCENE = preset_question("doublet-shear", {"flow.rate": 0.7})
SECONDS = 60.0
RACERS = 8


class Clock:
    """A time that passes when a test says so, and a little whenever it is read."""

    def __init__(self) -> None:
        self.present = datetime(2026, 1, 1, tzinfo=UTC)

    def __call__(self) -> datetime:
        self.present += timedelta(microseconds=1)
        return self.present

    def pass_by(self, seconds: float) -> None:
        self.present += timedelta(seconds=seconds)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def jobs(database: Database, store: Path, clock: Clock) -> Jobs:
    return Jobs(database, store, clock)


def submit(jobs: Jobs, owner: str = "ada", question: Question = SCENE) -> Job:
    return accepted(jobs, question, owner, 1, SECONDS).job


def leased(jobs: Jobs, worker: str = "worker") -> Lease:
    lease = jobs.lease(worker)
    assert lease is not None
    return lease


# What a job does.


def test_a_preset_becomes_the_study_or_the_scene_of_the_command_line():
    study = preset_question("critical-hamaker", {"search.tolerance": 0.1})
    assert (study.kind, study.name) == ("study", "critical-hamaker, search.tolerance=0.1")
    assert study.document == load_study("critical-hamaker", ["search.tolerance=0.1"])
    assert study.key == load_study("critical-hamaker", ["search.tolerance=0.1"]).key
    scene = preset_question("doublet-shear", {"flow.rate": 0.7})
    assert (scene.kind, scene.name) == ("scene", "doublet-shear")
    assert scene.key == run_key(load_scene("doublet-shear", ["flow.rate=0.7"]))


@pytest.mark.parametrize(
    ("model", "changes", "changed"),
    [
        (
            load_scene("doublet-shear"),
            {"flow.rate": 0.7},
            load_scene("doublet-shear", ["flow.rate=0.7"]),
        ),
        (
            load_study("critical-hamaker"),
            {"search.certify": True},
            load_study("critical-hamaker", ["search.certify=true"]),
        ),
    ],
)
def test_documents_take_changes_too(model, changes, changed):
    question = kind_of_model(model)(model)
    assert question.changed({}) is question
    assert question.changed(changes).document == changed


@pytest.mark.parametrize(
    ("name", "changes", "field"),
    [
        ("no-such-preset", {}, "no-such-preset"),
        ("../presets/doublet-shear", {}, "doublet-shear"),
        ("/etc/passwd", {}, "passwd"),
        ("doublet-shear", {"flow.rate": -1.0}, "flow.rate"),
        ("doublet-shear", {"nonsense": 1}, "nonsense"),
        ("critical-hamaker", {"scene.vesicles.reduced_area": 1.2}, "scene.vesicles.0.reduced_area"),
    ],
)
def test_bad_presets_and_changes_are_refused_with_the_field(name, changes, field):
    with pytest.raises(ValueError, match=field):
        preset_question(name, changes)


# Acceptance.


def test_an_accepted_job_is_what_was_asked_for(jobs, clock):
    submitted = accepted(jobs, SCENE, "ada", 2, SECONDS)
    assert submitted.new
    job = submitted.job
    assert jobs.get(job.id) == job
    assert jobs.document(job) == SCENE.fields
    assert (job.owner, job.kind, job.name, job.key) == ("ada", "scene", "doublet-shear", SCENE.key)
    assert (job.ranks, job.seconds, job.attempts, job.progress) == (2, SECONDS, 0, 0)
    assert job.status is JobStatus.ACCEPTED
    assert job.created == job.updated == clock.present
    assert job.started is None
    assert job.finished is None


def test_one_key_makes_one_job_however_many_ask_at_once(jobs):
    with ThreadPoolExecutor(50) as pool:
        requests = [pool.submit(accepted, jobs, SCENE, "ada", 1, SECONDS, "key", 1) for _ in range(50)]
    answers = [answer.result() for answer in requests]
    assert sum(answer.new for answer in answers) == 1
    assert {answer.job.id for answer in answers} == {job.id for job in jobs.latest(100)}
    assert len(jobs.latest(100)) == 1


def test_a_key_belongs_to_one_request_of_one_owner(jobs):
    first = accepted(jobs, SCENE, "ada", 1, SECONDS, "key")
    for question, ranks, seconds in [(OTHER_SCENE, 1, SECONDS), (SCENE, 2, SECONDS), (SCENE, 1, 2 * SECONDS)]:
        with pytest.raises(IdempotencyConflict, match="key"):
            accepted(jobs, question, "ada", ranks, seconds, "key")
    assert accepted(jobs, OTHER_SCENE, "bob", 1, SECONDS, "key").new
    jobs.dismiss(first.job.id)
    again = accepted(jobs, SCENE, "ada", 1, SECONDS, "key")
    assert not again.new
    assert again.job.status is JobStatus.DISMISSED


def test_an_owner_may_have_so_many_unfinished_jobs(jobs):
    for _ in range(3):
        accepted(jobs, SCENE, "ada", 1, SECONDS, most_unfinished=3)
    leased(jobs)
    with pytest.raises(TooManyJobs, match="3"):
        accepted(jobs, SCENE, "ada", 1, SECONDS, most_unfinished=3)
    assert accepted(jobs, SCENE, "bob", 1, SECONDS, most_unfinished=3).new
    jobs.dismiss(jobs.latest(1, owner="ada")[0].id)
    assert accepted(jobs, SCENE, "ada", 1, SECONDS, most_unfinished=3).new


def test_an_answer_is_repeated_even_to_an_owner_who_has_too_many(jobs):
    first = accepted(jobs, SCENE, "ada", 1, SECONDS, "key", 1)
    assert accepted(jobs, SCENE, "ada", 1, SECONDS, "key", 1).job == first.job


# Lists.


def test_records_are_the_jobs_as_they_are_sent(jobs):
    waiting = submit(jobs)
    assert jobs.records.one(waiting.id).json == waiting.model_dump_json()
    lease = leased(jobs)
    assert jobs.records.one(waiting.id).json == lease.job.model_dump_json()
    assert jobs.finish(lease, JobStatus.SUCCEEDED, "both “done” and more")
    done = jobs.get(waiting.id)
    assert done.started is not None
    assert done.finished is not None
    assert jobs.records.page(1) == [(waiting.id, done.model_dump_json())]


def test_pages_hold_every_job_once_while_others_come_in(jobs):
    submitted = [submit(jobs, owner).id for owner in ["ada", "bob"] * 6]
    pages, after = [], None
    while page := jobs.latest(5, after):
        pages.append(page)
        after = page[-1].id
        submit(jobs)
    assert [job.id for page in pages for job in page] == submitted[::-1]
    assert [len(page) for page in pages] == [5, 5, 2]


def test_lists_by_owner_and_status(jobs):
    for owner in ["ada", "bob", "ada"]:
        submit(jobs, owner)
    running = leased(jobs).job
    assert [job.owner for job in jobs.latest(10, owner="ada")] == ["ada", "ada"]
    assert [job.id for job in jobs.latest(10, status=JobStatus.RUNNING)] == [running.id]
    assert jobs.latest(10, owner="bob", status=JobStatus.RUNNING) == []
    assert jobs.counts() == dict.fromkeys(JobStatus, 0) | {JobStatus.ACCEPTED: 2, JobStatus.RUNNING: 1}


def test_what_is_not_there_is_said_so(jobs):
    for ask in (jobs.get, jobs.dismiss, lambda name: jobs.latest(1, after=name)):
        with pytest.raises(NoSuchJob, match="nothing"):
            ask("nothing")


# Leases.


def test_owners_take_turns_however_many_jobs_they_have(jobs):
    for owner in ["eve"] * 4 + ["ada"] * 2 + ["bob"]:
        submit(jobs, owner)
    assert [leased(jobs).job.owner for _ in range(7)] == ["eve", "ada", "bob", "eve", "ada", "eve", "eve"]
    assert jobs.lease("worker") is None


def test_the_oldest_job_of_an_owner_comes_first(jobs):
    submitted = [submit(jobs).id for _ in range(4)]
    assert [leased(jobs).job.id for _ in range(4)] == submitted


def test_the_job_of_a_worker_that_is_seen_to_have_died_is_taken_at_once(jobs):
    place, number, started = own_identity().split(" ")
    dead = f"{place} {number} {int(started) - 1}"
    job, other = submit(jobs), submit(jobs)
    assert leased(jobs, dead).job.id == job.id
    assert leased(jobs, own_identity()).job.id == job.id, "without waiting for the lease to run out"
    assert jobs.get(job.id).attempts == 2
    assert leased(jobs, own_identity()).job.id == other.id, "the living keep theirs"


def test_workers_that_ask_at_once_get_different_jobs(jobs):
    submitted = {submit(jobs, f"owner {number % 3}").id for number in range(40)}

    def take(worker: int) -> Iterator[str]:
        # None may only mean that another worker was faster.
        while jobs.counts()[JobStatus.ACCEPTED]:
            if (lease := jobs.lease(str(worker))) is not None:
                yield lease.job.id

    with ThreadPoolExecutor(RACERS) as pool:
        taken = [*itertools.chain(*pool.map(lambda worker: list(take(worker)), range(RACERS)))]
    assert len(taken) == len(submitted)
    assert set(taken) == submitted


def test_a_leased_job_runs(jobs, clock):
    submit(jobs)
    lease = leased(jobs)
    assert lease.document == SCENE.fields
    job = jobs.get(lease.job.id)
    assert job == lease.job
    assert (job.status, job.attempts, job.started) == (JobStatus.RUNNING, 1, job.updated)


def test_progress_never_falls(jobs):
    submit(jobs)
    lease = leased(jobs)
    states = []
    for progress in (10, 40, 30):
        assert jobs.heartbeat(lease, progress, f"at {progress}")
        states.append((jobs.get(lease.job.id).progress, jobs.get(lease.job.id).message))
    assert states == [(10, "at 10"), (40, "at 40"), (40, "at 30")]


@pytest.mark.parametrize("status", [JobStatus.SUCCEEDED, JobStatus.FAILED])
def test_a_finished_job_stays_so(jobs, status):
    submit(jobs)
    lease = leased(jobs)
    jobs.heartbeat(lease, 40, "on the way")
    assert jobs.finish(lease, status, "the end")
    job = jobs.get(lease.job.id)
    assert (job.status, job.message, job.finished) == (status, "the end", job.updated)
    assert job.progress == (100 if status is JobStatus.SUCCEEDED else 40)
    assert not jobs.finish(lease, JobStatus.FAILED, "again")
    assert not jobs.heartbeat(lease, 50, "again")
    assert not jobs.give_back(lease, "again")
    assert jobs.dismiss(job.id) == job
    assert jobs.get(job.id) == job
    assert jobs.lease("another") is None


def test_a_lease_lasts_as_long_as_it_is_renewed(jobs, clock):
    submit(jobs)
    lease = leased(jobs)
    for _ in range(5):
        clock.pass_by(0.9 * LEASE_SECONDS)
        assert jobs.lease("another") is None
        assert jobs.heartbeat(lease, 0, "")


def test_the_job_of_a_lost_worker_goes_to_another_one_and_the_lost_one_can_change_nothing(jobs, clock):
    first, second = submit(jobs), submit(jobs)
    lost = leased(jobs, "lost")
    clock.pass_by(1.1 * LEASE_SECONDS)
    # Its place in the queue is still the first.
    found = leased(jobs, "another")
    assert found.job.id == lost.job.id == first.id
    assert found.job.attempts == 2
    assert found.job.started == lost.job.started
    before = jobs.get(first.id)
    assert not jobs.heartbeat(lost, 99, "too late")
    assert not jobs.give_back(lost, "too late")
    assert not jobs.finish(lost, JobStatus.FAILED, "too late")
    assert jobs.get(first.id) == before
    assert jobs.finish(found, JobStatus.SUCCEEDED, "done")
    assert leased(jobs).job.id == second.id


def test_what_is_given_back_is_leased_again(jobs):
    submit(jobs)
    lease = leased(jobs)
    assert jobs.give_back(lease, "stopped")
    job = jobs.get(lease.job.id)
    assert (job.status, job.message) == (JobStatus.ACCEPTED, "stopped")
    assert not jobs.finish(lease, JobStatus.SUCCEEDED, "too late")
    assert leased(jobs).job.attempts == 2


def test_a_job_that_waits_after_a_crash_lets_the_next_one_of_its_owner_begin(jobs, clock):
    first, second = submit(jobs), submit(jobs)
    lease = leased(jobs)
    assert jobs.give_back(lease.crashed(), "crashed", 10.0)
    assert leased(jobs).job.id == second.id
    assert jobs.lease("worker") is None
    clock.pass_by(10.0)
    again = leased(jobs)
    assert (again.job.id, again.crashes) == (first.id, 1)


def test_crashes_are_counted_until_a_job_comes_further(jobs, clock):
    submit(jobs)
    for crashes, reached in enumerate([5.0, 5.0, 3.0]):
        lease = leased(jobs)
        assert lease.crashes == crashes
        assert jobs.heartbeat(lease.at(reached), 5, "")
        assert jobs.give_back(lease.at(reached).crashed(), "crashed")
    clock.pass_by(1.0)
    lease = leased(jobs)
    assert (lease.crashes, lease.reached) == (3, 5.0)
    assert jobs.heartbeat(lease.at(6.0), 6, "")
    clock.pass_by(1.1 * LEASE_SECONDS)
    lost = leased(jobs, "another")
    assert (lost.crashes, lost.reached) == (1, 6.0)
    assert jobs.give_back(lost, "stopped")
    assert leased(jobs).crashes == 1, "a stop is no crash"


def test_a_dismissed_job_is_taken_from_its_worker(jobs):
    job = submit(jobs)
    lease = leased(jobs)
    dismissed = jobs.dismiss(job.id)
    assert (dismissed.status, dismissed.finished) == (JobStatus.DISMISSED, dismissed.updated)
    assert not jobs.heartbeat(lease, 50, "still here")
    assert not jobs.finish(lease, JobStatus.SUCCEEDED, "done")
    assert jobs.get(job.id) == dismissed
    assert jobs.lease("another") is None


def test_a_waiting_job_can_be_dismissed(jobs):
    job = submit(jobs)
    assert jobs.dismiss(job.id).status is JobStatus.DISMISSED
    assert jobs.lease("worker") is None


class Queue(RuleBasedStateMachine):
    """Anything that owners, workers and time can do, in any order."""

    def __init__(self) -> None:
        super().__init__()
        self.directory = tempfile.TemporaryDirectory()
        store = Path(self.directory.name)
        self.database = Database.open(f"sqlite:///{store}/jobs.sqlite", store)
        self.clock = Clock()
        self.jobs = Jobs(self.database, store, self.clock)
        self.submitted: set[str] = set()
        self.leases: list[Lease] = []
        self.finished: Counter[str] = Counter()

    def teardown(self) -> None:
        self.database.close()
        self.directory.cleanup()

    @rule(owner=st.sampled_from(["ada", "bob", "eve"]))
    def submit(self, owner: str) -> None:
        self.submitted.add(submit(self.jobs, owner).id)

    @rule()
    def lease(self) -> None:
        waiting = self.jobs.counts()[JobStatus.ACCEPTED]
        lease = self.jobs.lease("worker")
        assert lease is not None or not waiting
        if lease is not None:
            self.leases.append(lease)

    @precondition(lambda self: self.leases)
    @rule(data=st.data(), action=st.sampled_from(["heartbeat", "finish", "give_back", "dismiss"]))
    def use_a_lease(self, data: st.DataObject, action: str) -> None:
        lease = data.draw(st.sampled_from(self.leases))
        before = self.jobs.get(lease.job.id)
        valid = before.status is JobStatus.RUNNING and before.attempts == lease.job.attempts
        if action == "heartbeat":
            assert self.jobs.heartbeat(lease, 50, "half") == valid
        elif action == "give_back":
            assert self.jobs.give_back(lease, "back") == valid
        elif action == "finish":
            assert self.jobs.finish(lease, JobStatus.SUCCEEDED, "done") == valid
            self.finished[lease.job.id] += valid
        else:
            was_unfinished = not before.status.finished
            assert self.jobs.dismiss(lease.job.id).status.finished
            self.finished[lease.job.id] += was_unfinished

    @rule(leases=st.floats(0, 1.5))
    def wait(self, leases: float) -> None:
        self.clock.pass_by(leases * LEASE_SECONDS)

    @invariant()
    def none_is_lost_and_none_finishes_twice(self) -> None:
        jobs = {job.id: job for job in self.jobs.latest(1000)}
        assert jobs.keys() == self.submitted
        assert set(self.finished.values()) <= {0, 1}
        assert {name for name, job in jobs.items() if job.status.finished} == {
            name for name, times in self.finished.items() if times
        }


TestQueue = Queue.TestCase
TestQueue.settings = settings(max_examples=25, stateful_step_count=25, deadline=None)
