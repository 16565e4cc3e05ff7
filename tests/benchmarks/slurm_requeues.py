"""A long run in several jobs of Slurm, each ended as ahead of its time limit: are the bits those of one job?

    python -m tests.benchmarks.slurm_requeues DIRECTORY --vesicles 256 --jobs 10   # as root

It takes a cluster of its own, of this machine.  The figures are printed as JSON.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from ensemble.store.checkpoint import checkpointed_keys
from tests import slurm
from tests.benchmarks.restarts import bits_of_only_run, newest_checkpoint

SCRIPT = Path(__file__).parents[2] / "deploy" / "bisect.slurm"
RANKS = 2


def run_in_jobs(cluster: slurm.Cluster, arguments: Sequence[str], jobs: int, directory: Path) -> Path:
    """Make a run in so many jobs, each of which gets as far as a checkpoint of its own; return the store."""
    store, log = directory / "store", directory / "log"
    job = cluster.submit(
        *(f"--ntasks={RANKS}", "--time=60", f"--output={log}", SCRIPT, *arguments),
        ENSEMBLE_COMMAND="run",
        ENSEMBLE_ENVIRONMENT=sys.prefix,
        ENSEMBLE_STORE=str(store),
        ENSEMBLE_CHECKPOINT_SECONDS="0.2",
    )
    for times in range(1, jobs):
        earlier = newest_checkpoint(store)
        wait_while_going_on(cluster, job, log, lambda earlier=earlier: newest_checkpoint(store) > earlier)
        # To the ranks and not to the script, as the signal ahead of a time limit.
        cluster.run("scancel", "--signal=TERM", job)
        cluster.wait_until_requeued(job, times)
    assert cluster.wait(job)["JobState"] == "COMPLETED", log.read_text(encoding="utf-8")
    assert log.read_text(encoding="utf-8").count("goes on from its checkpoint") == jobs - 1
    assert not set(checkpointed_keys(store))
    return store


def wait_while_going_on(cluster: slurm.Cluster, job: str, log: Path, condition: Callable[[], object]) -> None:
    """Wait until something is true; fail with the log if the job ends before."""
    while not condition():
        assert job in cluster.jobs(), log.read_text(encoding="utf-8")
        time.sleep(0.1)


def main() -> None:
    """Run in one job and in several, compare and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory", type=Path)
    parser.add_argument("--vesicles", type=int, default=256)
    parser.add_argument("--jobs", type=int, default=10)
    parser.add_argument("--horizon", type=float, default=0.5)
    options = parser.parse_args()
    scene = [
        "suspension-shear",
        f"--set=arrangement.count={options.vesicles}",
        f"--set=horizon={options.horizon}",
    ]
    bits, seconds = [], []
    with slurm.running() as cluster:
        for jobs in (1, options.jobs):
            directory = options.directory / f"{jobs} jobs"
            directory.mkdir(parents=True)
            begin = time.monotonic()
            bits.append(bits_of_only_run(run_in_jobs(cluster, scene, jobs, directory)))
            seconds.append(time.monotonic() - begin)
    print(
        json.dumps(
            {"same bits": bits[0] == bits[1], "seconds in one job": seconds[0], "in several": seconds[1]}
        )
    )


if __name__ == "__main__":
    main()
