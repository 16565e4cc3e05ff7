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
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil

from ensemble.config.checkpoint_interval import CHECKPOINT_SECONDS
from ensemble.errors import SUSPENDED_STATUS
from ensemble.store import Store
from ensemble.store.checkpoint import checkpoint_path, checkpointed_keys
from tests.api.processes import wait_until
from tests.benchmarks.signals import Job
from tests.solver.restarts import arrays_of

INTERVAL = 0.2  # seconds between checkpoints


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
DENSE = {"output.interval": 0.003, "output.frame_interval": 0.01}
CUTS = {
    "doublet in shear": Cut("doublet-shear", SHEAR),
    "dense record": Cut("doublet-shear", BRIEF | DENSE | {"horizon": 30.0, "criteria.revolutions": 1000}),
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
    since_checkpoint: float = 0.0  # the longest time from a checkpoint to a signal, in seconds
    faults: list[str] = field(default_factory=list)


class Undisturbed:
    """A run that nothing ends.

    Parameters
    ----------
    directory : Path
        New, for its store.
    cut : Cut
        What is run.

    Attributes
    ----------
    bits : dict
        All that the run holds.
    seconds : float
        From its first checkpoint to its end.
    """

    def __init__(self, directory: Path, cut: Cut) -> None:
        directory.mkdir(parents=True)
        self.cut = cut
        job = started(cut, directory)
        wait_until(lambda: newest_checkpoint(directory / "store") or job.launcher.poll() is not None)
        begin = time.monotonic()
        job.launcher.wait()
        self.seconds = time.monotonic() - begin
        self.bits = bits_of_only_run(directory / "store")


class Restarts:
    """Runs of one scene that are ended by one signal and go on.

    Parameters
    ----------
    directory : Path
        New, for their store.
    undisturbed : Undisturbed
        What they are compared with.
    number : signal
    seed : int
        Of the moments.
    """

    def __init__(self, directory: Path, undisturbed: Undisturbed, number: signal.Signals, seed: int) -> None:
        directory.mkdir(parents=True)
        self._undisturbed, self._signal = undisturbed, number
        self._chance = random.Random(seed)
        self._directory, self._store = directory, directory / "store"
        self.tally = Tally()

    def go_on(self) -> None:
        """Make a job that is ended at some moment after its first checkpoint, unless it is done before."""
        earlier = newest_checkpoint(self._store)
        job = started(self._undisturbed.cut, self._directory)
        try:
            wait_until(lambda: newest_checkpoint(self._store) > earlier or job.launcher.poll() is not None)
            time.sleep(self._chance.uniform(0.0, self._undisturbed.seconds))
            in_time = job.launcher.poll() is None
            if in_time:
                self._end(job)
            if job.wait() is None:
                self.tally.faults.append("hung")
        finally:
            job.end()
        self.tally.signals += in_time
        self.tally.resumed += job.said.count("goes on from its checkpoint")
        status = job.launcher.returncode
        if "Traceback" in job.said or "begins anew" in job.said:
            self.tally.faults.append(job.said)
        # Between the commit and the end of a process a signal ends it as one that has no run in progress.
        kept = self._is_kept()
        allowed = status in (0, SUSPENDED_STATUS) or kept or (in_time and self._signal is signal.SIGKILL)
        if not allowed:
            self.tally.faults.append(f"status {status}: {job.said}")
        if kept:
            self._compare()
        elif status == 0:
            self.tally.faults.append("an answer whose run is not kept")

    def _end(self, job: Job) -> None:
        if written := newest_checkpoint(self._store):  # else the run has just been committed
            self.tally.since_checkpoint = max(self.tally.since_checkpoint, time.time() - written)
        part = self._chance.choice(["launcher", "rank"]) if self._signal is signal.SIGKILL else "launcher"
        with suppress(psutil.NoSuchProcess):  # it has just ended
            (job.victim(part, self._chance) or job.launcher).send_signal(self._signal)

    def _is_kept(self) -> bool:
        with Store.existing(self._store) as store:
            return store.count_runs() > 0

    def _compare(self) -> None:
        self.tally.done += 1
        if bits_of_only_run(self._store) != self._undisturbed.bits:
            self.tally.faults.append("other bits")
        with Store.open(self._store) as store:
            (summary,) = store.summaries()
            self.tally.faults += store.check()
            store.set_aside(summary.key)
        self.tally.faults += [f"checkpoint left: {key}" for key in checkpointed_keys(self._store)]


def started(cut: Cut, directory: Path) -> Job:
    """Start a job that makes a run for the store in a directory."""
    arguments = [*cut.arguments, f"--store={directory / 'store'}"]
    return Job(cut.ranks, arguments, directory, **{CHECKPOINT_SECONDS: str(INTERVAL)})


def newest_checkpoint(store: Path) -> float:
    """Return when it was written; 0 if there is none."""
    written = 0.0
    for key in checkpointed_keys(store):
        with suppress(FileNotFoundError):  # its run has just been committed
            written = max(written, checkpoint_path(store, key).stat().st_mtime)
    return written


def bits_of_only_run(path: Path) -> dict[str, Any]:
    """Return all that the only run in a store holds, but its wall time."""
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
    series = {}
    for place, name in enumerate(options.scenes):
        directory = options.directory / str(place)
        undisturbed = Undisturbed(directory / "undisturbed", CUTS[name])
        for number in (signal.SIGKILL, signal.SIGTERM):
            series[name, number] = Restarts(
                directory / number.name, undisturbed, number, options.seed + place
            )
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
