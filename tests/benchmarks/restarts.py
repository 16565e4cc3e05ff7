"""Ends runs at random moments, goes on with them, and compares them with undisturbed ones bit for bit.

    python -m tests.benchmarks.restarts --tries 100 DIRECTORY

Every scene is run again and again by `ensemble run`, on as many ranks each time.  SIGKILL goes to `mpirun` or
to a rank, SIGTERM to `mpirun`.  The command is repeated until the run is done; then it is set aside, and the
next one begins.  A table of what came of it is printed.
"""

from __future__ import annotations

import argparse
import random
import signal
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ensemble.config.checkpoint_interval import CHECKPOINT_SECONDS
from ensemble.store import Store
from ensemble.store.checkpoint import checkpoint_path, checkpointed_keys
from tests.benchmarks.signals import Job
from tests.solver.restarts import arrays_of

INTERVAL = 0.2  # seconds between checkpoints
HANG = "hung"


@dataclass(frozen=True)
class Cut:
    """A scene that takes a few seconds, and on how many ranks it is run."""

    preset: str
    changes: Mapping[str, Any]
    ranks: int = 1

    @property
    def arguments(self) -> list[str]:
        """Of the command line."""
        return ["run", self.preset, *(f"--set={path}={value}" for path, value in self.changes.items())]


SHEAR = {"horizon": 150.0, "criteria.revolutions": 1000}
BRIEF = {"numerics.points": 32, "numerics.tolerance": 1e-4}
CUTS = {
    "doublet in shear": Cut("doublet-shear", SHEAR),
    "trap, relaxed start": Cut("doublet-trap", {"numerics.tolerance": 1e-5}),
    "automatic points": Cut("doublet-shear", SHEAR | {"numerics.points": '"auto"'}),
    "24 vesicles, two ranks": Cut("suspension-shear", {"arrangement.count": 24, "horizon": 1.0}, ranks=2),
    "rosenbrock": Cut("doublet-shear", BRIEF | {"numerics.integrator": '"rosenbrock"', "horizon": 40.0}),
    "sdc": Cut("doublet-shear", BRIEF | {"numerics.integrator": '"sdc"', "horizon": 20.0}),
    "imex-euler": Cut("doublet-shear", BRIEF | {"numerics.integrator": '"imex-euler"', "horizon": 2.0}),
}


@dataclass
class Tally:
    """What became of the tries with one scene and one signal."""

    signals: int = 0
    resumed: int = 0  # jobs that went on from a checkpoint
    done: int = 0  # runs that came to their end and were compared
    since_checkpoint: float = 0.0  # the longest time from a checkpoint of a job to its signal, in seconds
    faults: list[str] = field(default_factory=list)


class Restarts:
    """Runs of one scene that are ended by one signal and go on.

    Parameters
    ----------
    directory : Path
        New, for the stores.
    cut : Cut
        What is run.
    number : signal
    seed : int
        Of the moments.
    """

    def __init__(self, directory: Path, cut: Cut, number: signal.Signals, seed: int) -> None:
        directory.mkdir(parents=True)
        self._cut, self._signal = cut, number
        self._chance = random.Random(seed)
        self._directory, self._store = directory, directory / "store"
        begin = time.monotonic()
        job = self._job(directory / "undisturbed")
        job.launcher.wait()
        self._longest = time.monotonic() - begin
        self._expected = self._finished(directory / "undisturbed")
        self.tally = Tally()

    def go_on(self) -> None:
        """Make a job that is ended, unless it is done before."""
        began = time.time()
        job = self._job(self._store)
        try:
            time.sleep(self._chance.uniform(0.1, 1.0) * self._longest)
            in_time = job.launcher.poll() is None
            if in_time:
                self._end(job, began)
            if job.wait() is None:
                self.tally.faults.append(HANG)
        finally:
            job.end()
        self.tally.signals += in_time
        self.tally.resumed += job.said.count("goes on from its checkpoint")
        if "Traceback" in job.said or "begins anew" in job.said:
            self.tally.faults.append(job.said)
        status = job.launcher.returncode
        if in_time and self._signal is signal.SIGTERM and status not in (0, 75, 143):
            self.tally.faults.append(f"status {status}")
        if status == 0:
            self._compare()
        elif not in_time:
            self.tally.faults.append(f"status {status}: {job.said}")

    def _job(self, store: Path) -> Job:
        arguments = [*self._cut.arguments, f"--store={store}"]
        return Job(self._cut.ranks, arguments, self._directory, **{CHECKPOINT_SECONDS: str(INTERVAL)})

    def _end(self, job: Job, began: float) -> None:
        paths = (checkpoint_path(self._store, key) for key in checkpointed_keys(self._store))
        kept = max((path.stat().st_mtime for path in paths), default=0.0)
        if kept > began:
            self.tally.since_checkpoint = max(self.tally.since_checkpoint, time.time() - kept)
        part = self._chance.choice(["launcher", "rank"]) if self._signal is signal.SIGKILL else "launcher"
        victim = job.victim(part, self._chance)
        if victim is None:
            job.launcher.send_signal(self._signal)
        else:
            victim.send_signal(self._signal)

    def _compare(self) -> None:
        self.tally.done += 1
        if self._finished(self._store) != self._expected:
            self.tally.faults.append("other bits")
        with Store.open(self._store) as store:
            (summary,) = store.summaries()
            self.tally.faults += store.check()
            store.set_aside(summary.key)
        left = list(checkpointed_keys(self._store))
        self.tally.faults += [f"checkpoint left: {key}" for key in left]

    def _finished(self, path: Path) -> dict[str, Any]:
        with Store.existing(path) as store:
            (summary,) = store.summaries()
            return arrays_of(store.load(summary.key))


def main() -> None:
    """Send signals, compare and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory", type=Path)
    parser.add_argument("--tries", type=int, default=100, help="of each signal with each scene")
    parser.add_argument("--seed", type=int, default=16)
    parser.add_argument("--scenes", nargs="+", choices=CUTS, default=CUTS)
    parser.add_argument("--minutes", type=float, default=600.0, help="after which fewer tries are enough")
    options = parser.parse_args()
    deadline = time.monotonic() + 60 * options.minutes
    series = {
        (name, number): Restarts(
            options.directory / f"{place}-{number.name}", CUTS[name], number, options.seed + place
        )
        for place, name in enumerate(options.scenes)
        for number in (signal.SIGKILL, signal.SIGTERM)
    }
    for _ in range(options.tries):
        for restarts in series.values():
            if time.monotonic() < deadline:
                restarts.go_on()
    print("| scene | signal | sent | went on | done, compared | most s since a checkpoint | faults |")
    print("|---|---|---|---|---|---|---|")
    for (name, number), restarts in series.items():
        found = restarts.tally
        print(
            f"| {name} | {number.name} | {found.signals} | {found.resumed} | {found.done} "
            f"| {found.since_checkpoint:.1f} | {len(found.faults)} |"
        )
        for fault in found.faults:
            print(name, number.name, fault, file=sys.stderr)


if __name__ == "__main__":
    main()
