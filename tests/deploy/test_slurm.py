"""Studies under a real Slurm: a job that queues itself again, both launchers, arrays on one store."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path

import pytest

from ensemble.store import Store
from ensemble.store.checkpoint import checkpointed_keys
from tests import slurm
from tests.benchmarks.restarts import CUTS, bits_of_only_run
from tests.benchmarks.slurm_requeues import SCRIPT, run_in_jobs, wait_while_going_on
from tests.conftest import ENSEMBLE, QUICK_STUDY, Finished, Launcher

pytestmark = pytest.mark.long  # each starts ranks that trace the quick study: 10 to 20 s of processor time


def answer(log: Path) -> dict:
    """Return the document in the log of a job: everything from the first line that begins one."""
    text = log.read_text(encoding="utf-8")
    document, _ = json.JSONDecoder().raw_decode(text[text.index("\n{") + 1 if "\n{" in text else 0 :])
    return document


def brackets(document: dict) -> list[tuple]:
    return [
        (point["parameters"], point["bracket"], point["outcomes"], point["status"])
        for point in document["boundary"]
    ]


def runs(store: Path) -> int:
    if not (store / "runs").exists():
        return 0
    with Store.existing(store) as opened:
        return opened.count_runs()


def test_a_study_that_is_told_to_end_queues_itself_again_and_goes_on(
    slurm_cluster: slurm.Cluster, finished_study: Finished, tmp_path: Path
) -> None:
    store, log = tmp_path / "store", tmp_path / "log"
    job = slurm_cluster.submit(
        *("--ntasks=2", "--time=5", f"--output={log}", SCRIPT, "critical-hamaker", *QUICK_STUDY, "--json"),
        ENSEMBLE_ENVIRONMENT=sys.prefix,
        ENSEMBLE_STORE=str(store),
    )
    wait_while_going_on(slurm_cluster, job, log, lambda: runs(store) >= 2)
    # To the ranks and not to the script, as the signal ahead of a time limit.
    slurm_cluster.run("scancel", "--signal=TERM", job)
    slurm_cluster.wait_until_requeued(job)
    kept = set(checkpointed_keys(store))
    assert kept
    assert slurm_cluster.wait(job)["JobState"] == "COMPLETED", log.read_text(encoding="utf-8")
    assert brackets(answer(log)) == brackets(finished_study.document)
    assert any(f"run {key} goes on from its checkpoint" in log.read_text(encoding="utf-8") for key in kept)


def test_a_run_in_several_jobs_ends_with_the_same_bits(
    slurm_cluster: slurm.Cluster, launcher: Launcher, tmp_path: Path
) -> None:
    cut = CUTS["24 vesicles, two ranks"]
    arguments = [*cut.arguments[1:], "--set=horizon=4.0"]
    undisturbed = launcher.run(2, [*ENSEMBLE, "run", *arguments, f"--store={tmp_path / 'undisturbed'}"])
    assert undisturbed.returncode == 0, undisturbed.stderr
    store = run_in_jobs(slurm_cluster, arguments, 3, tmp_path)
    assert bits_of_only_run(store) == bits_of_only_run(tmp_path / "undisturbed")


def test_a_canceled_job_does_not_queue_itself_again(slurm_cluster: slurm.Cluster, tmp_path: Path) -> None:
    store, log = tmp_path / "store", tmp_path / "log"
    job = slurm_cluster.submit(
        *("--ntasks=2", "--time=5", f"--output={log}", SCRIPT, "critical-hamaker"),
        ENSEMBLE_ENVIRONMENT=sys.prefix,
        ENSEMBLE_STORE=str(store),
    )
    wait_while_going_on(slurm_cluster, job, log, store.exists)
    slurm_cluster.run("scancel", job)
    ended = slurm_cluster.wait(job)
    assert (ended["JobState"], ended["Restarts"]) == ("CANCELLED", "0")


def test_mpirun_within_a_job(
    slurm_cluster: slurm.Cluster, launcher: Launcher, bisect_command, finished_study, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    command = launcher.command(2, bisect_command(tmp_path / "store"))
    script = slurm.write_script(tmp_path / "script", [shlex.join(command)])
    path = launcher.environment["PATH"]
    job = slurm_cluster.submit("--ntasks=2", f"--output={log}", script, PATH=path)
    assert slurm_cluster.wait(job)["JobState"] == "COMPLETED", log.read_text(encoding="utf-8")
    assert brackets(answer(log)) == brackets(finished_study.document)


def test_the_jobs_of_an_array_share_a_store(slurm_cluster: slurm.Cluster, tmp_path: Path) -> None:
    store = tmp_path / "store"
    coarse = "--set numerics.points=32 --set numerics.tolerance=1e-3 --set criteria.revolutions=1"
    command = shlex.join([*ENSEMBLE, "run", "doublet-shear", f"--store={store}"])
    line = f"srun {command} {coarse} --set flow.rate=0.5$SLURM_ARRAY_TASK_ID"
    script = slurm.write_script(tmp_path / "script", [line])
    slurm_cluster.submit("--wait", "--ntasks=1", "--array=1-4", f"--output={tmp_path}/log-%a", script)
    with Store.existing(store) as opened:
        rates = sorted(summary.scene.flow.rate for summary in opened.summaries())
        assert rates == pytest.approx([0.51, 0.52, 0.53, 0.54])
        assert opened.check() == []
