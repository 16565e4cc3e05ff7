"""Runs that signals end go on to the same bits; `tests.benchmarks.restarts` makes more of them."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest

from ensemble.config.checkpoint_interval import CHECKPOINT_SECONDS
from ensemble.errors import SUSPENDED_STATUS
from ensemble.store import Store
from ensemble.store.checkpoint import checkpoint_path, checkpointed_keys
from tests.api.processes import wait_until
from tests.benchmarks.restarts import CUTS, Restarts, Undisturbed
from tests.benchmarks.signals import ALONE, Job
from tests.conftest import ENSEMBLE, QUICK_STUDY

pytestmark = pytest.mark.usefixtures("finished_study")  # the kernels are compiled


@pytest.mark.long
@pytest.mark.parametrize(
    "scene", ["doublet in shear", "dense record", "trap, relaxed start", "24 vesicles, two ranks"]
)
def test_an_interrupted_run_ends_with_the_same_bits(tmp_path: Path, scene: str) -> None:
    undisturbed = Undisturbed(tmp_path / "undisturbed", CUTS[scene])
    for number in (signal.SIGTERM, signal.SIGKILL):
        restarts = Restarts(tmp_path / number.name, undisturbed, number, seed=5)
        while not (restarts.tally.done and restarts.tally.resumed):
            restarts.go_on()
        assert restarts.tally.faults == []


ENDLESS = (
    *("run", "doublet-shear", "--set=horizon=1e5", "--set=criteria.revolutions=100000"),
    *("--set=numerics.points=32", "--set=numerics.tolerance=1e-3"),
)


@contextmanager
def running(tmp_path: Path, ranks: int, *arguments: str) -> Iterator[Job]:
    """A run that has written a checkpoint and goes on, as if it had no end."""
    tmp_path.joinpath("job").mkdir(exist_ok=True)
    arguments = (*ENDLESS, *arguments, f"--store={tmp_path / 'store'}")
    job = Job(ranks, arguments, tmp_path / "job", **{CHECKPOINT_SECONDS: "0.1"})
    try:
        wait_until(lambda: job.launcher.poll() is not None or any(checkpointed_keys(tmp_path / "store")))
        yield job
    finally:
        job.end()


def ended(job: Job) -> tuple[int, str]:
    """The status of a job, and what it has said."""
    assert job.wait() is not None
    return job.launcher.wait(), job.said


def rank_of(job: Job, number: int) -> psutil.Process:
    return next(each for each in job.members() if each.environ().get("PMI_RANK") == str(number))


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGUSR1])
def test_a_signal_ends_a_run_after_a_step(tmp_path: Path, number: signal.Signals) -> None:
    with running(tmp_path, ALONE) as job:
        job.launcher.send_signal(number)
        status, said = ended(job)
    assert status == SUSPENDED_STATUS
    assert said.count("ends after the next step") == said.count("ensemble: ") == 1
    (key,) = checkpointed_keys(tmp_path / "store")
    with running(tmp_path, 2) as job:  # any number of ranks goes on
        wait_until(lambda: f"run {key} goes on from its checkpoint" in job.said)


@pytest.mark.parametrize(("ranks", "sharing"), [(2, 2), (2, 1)])
def test_a_signal_to_any_rank_ends_all_after_a_step(tmp_path: Path, ranks: int, sharing: int) -> None:
    """Also one to a rank that has no part in the run."""
    with running(tmp_path, ranks, f"--ranks-per-run={sharing}") as job:
        rank_of(job, 1).send_signal(signal.SIGTERM)
        status, said = ended(job)
    assert status == SUSPENDED_STATUS
    assert said.count("ends after the next step") == said.count("ensemble: ") == 1


@pytest.mark.parametrize("ranks", [ALONE, 2])
def test_a_second_signal_ends_a_run_at_once(tmp_path: Path, ranks: int) -> None:
    with running(tmp_path, ranks) as job:
        process = psutil.Process(job.launcher.pid) if ranks == ALONE else rank_of(job, 0)
        process.suspend()  # so that no step lies between the signals
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGTERM)
        process.resume()
        status, said = ended(job)
    assert status not in (0, SUSPENDED_STATUS)
    assert "ensemble: interrupted" in said
    assert "Traceback" not in said


def test_a_run_that_no_store_keeps_is_ended_at_once(tmp_path: Path) -> None:
    tmp_path.joinpath("job").mkdir()
    job = Job(ALONE, [*ENDLESS, "--no-store", "--progress=json"], tmp_path / "job")
    try:
        wait_until(lambda: "time" in job.said)
        job.launcher.send_signal(signal.SIGTERM)
        status, said = ended(job)
    finally:
        job.end()
    assert status == 128 + signal.SIGTERM
    assert said.count("ensemble: ") == 1


def test_a_damaged_checkpoint_is_told_of_and_not_used(tmp_path: Path) -> None:
    with running(tmp_path, ALONE) as job:
        job.launcher.send_signal(signal.SIGTERM)
        ended(job)
    (key,) = checkpointed_keys(tmp_path / "store")
    path = checkpoint_path(tmp_path / "store", key)
    path.write_bytes(path.read_bytes()[:1000])
    with running(tmp_path, ALONE) as job:
        wait_until(lambda: f"run {key} begins anew, its checkpoint cannot be used: it is damaged" in job.said)
        wait_until(lambda: path.stat().st_size > 1000)


def test_the_interval_is_checked_before_there_is_a_store(ensemble, tmp_path: Path) -> None:
    store = tmp_path / "store"
    command = ["run", "doublet-shear", f"--store={store}"]
    refused = ensemble(*command, environment={CHECKPOINT_SECONDS: "often"})
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    assert f"{CHECKPOINT_SECONDS}: 'often' — must be" in refused.stderr
    assert not store.exists()


@pytest.mark.long
def test_all_groups_of_a_study_keep_their_runs(launcher, finished_study, tmp_path: Path) -> None:
    store = tmp_path / "store"
    arguments = ("bisect", *QUICK_STUDY, f"--store={store}", "--json")
    kept: set[str] = set()
    while not kept:  # runs that end with their next step, or have taken none, leave none to keep
        job = Job(2, arguments, tmp_path, **{CHECKPOINT_SECONDS: "0.05"})
        try:
            wait_until(
                lambda: len(list(checkpointed_keys(store))) == 2 and len(list((store / "runs").iterdir())) > 1
            )
            job.launcher.send_signal(signal.SIGUSR1)
            status, _ = ended(job)
        finally:
            job.end()
        assert status == SUSPENDED_STATUS
        kept = set(checkpointed_keys(store))
    result = launcher.run(2, [*ENSEMBLE, *arguments])
    assert result.returncode == 0, result.stderr
    assert result.stderr.count("goes on from its checkpoint") >= 1
    boundary, expected = json.loads(result.stdout)["boundary"], finished_study.document["boundary"]
    assert [point["bracket"] for point in boundary] == [point["bracket"] for point in expected]
    with Store.existing(store) as opened:
        assert opened.check() == []
        assert not kept & {key for key in checkpointed_keys(store) if opened.contains(key)}
