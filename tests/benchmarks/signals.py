"""Sends signals to studies at random moments and counts what they cost.

    python -m tests.benchmarks.signals --tries 500 DIRECTORY

Each try starts `ensemble bisect`, alone or on one to four ranks, and sends SIGINT, SIGTERM or SIGKILL to the
launcher, its proxy, a rank, or to the launcher's process group as a terminal does.  The next try goes on in
the same store, until a job has given its answer before its signal.  The figures are printed as JSON.

MPICH's proxy itself ignores SIGINT and SIGTERM, and tells nobody.  Then the job must come to its end as if
nothing had happened; such tries are counted apart.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any
from uuid import uuid4

import psutil

from ensemble.store import Store
from tests.api.processes import alive

MARK = "ENSEMBLE_SIGNAL_FAMILY"
HANG_SECONDS = 120.0
LEFT_SECONDS = 2.0  # after which no process may be left
EARLIEST, START, LATEST = 0.1, 3.0, 9.0  # seconds after the start; half of the signals fall into the start

STUDY = (
    *("bisect", "--json", "--tolerance=0.2", "--set=sweep.values=[0.5]"),
    *("--set=scene.numerics.points=32", "--set=scene.numerics.tolerance=1e-3"),
)
TRACES = re.compile(r"Traceback|Exception ignored|Fatal Python error|Segmentation|Assertion failed|core dump")

ALONE = 0  # ranks of a job without a launcher
SIGNALS = {"SIGINT": signal.SIGINT, "SIGTERM": signal.SIGTERM, "SIGKILL": signal.SIGKILL}
VICTIMS = ("launcher", "proxy", "rank", "group")


@dataclass(frozen=True)
class Plan:
    """What is done to a job."""

    ranks: int
    victim: str
    signal: str
    moment: float

    @property
    def is_ignored(self) -> bool:
        """Whether the signal has no effect."""
        return self.victim == "proxy" and self.signal != "SIGKILL"

    @classmethod
    def draw(cls, chance: random.Random, earliest: float) -> Plan:
        """Draw a plan, with a signal some seconds after the start at the earliest."""
        ranks = chance.randrange(5)
        name = chance.choice(list(SIGNALS))
        victims = VICTIMS if ranks != ALONE else ("launcher",)
        latest = START if chance.random() < 0.5 else LATEST
        return cls(ranks, chance.choice(victims), name, chance.uniform(earliest, latest))


@dataclass
class Try:
    """What came of it."""

    plan: Plan
    seconds: float  # from the signal until no process was left
    status: int | None  # of the launcher
    said: str
    left: list[str]  # parts that hung
    faults: list[str] = field(default_factory=list)


class Job:
    """A command in a session of its own; all of its processes inherit a mark.

    Parameters
    ----------
    ranks : int
        `ALONE` without a launcher.
    arguments : sequence of str
        Of `ensemble`.
    directory : Path
        For what it prints.
    **variables : str
        Added to its environment.
    """

    def __init__(self, ranks: int, arguments: Sequence[str], directory: Path, **variables: str) -> None:
        self._mark = uuid4().hex
        self._known: set[psutil.Process] = set()
        beside = Path(sys.executable).parent
        command = [sys.executable, "-m", "ensemble", *arguments]
        if ranks != ALONE:
            command = [str(beside / "mpirun"), "-n", str(ranks), *command]
        path = os.pathsep.join([str(beside), os.environ["PATH"]])
        # Files and not pipes: a process that is left behind must not keep us waiting.
        self._printed, self._said = directory / "printed", directory / "said"
        with self._printed.open("w") as printed, self._said.open("w") as said:
            self.launcher = subprocess.Popen(
                command,
                env=os.environ | {"PATH": path, MARK: self._mark} | variables,
                stdin=subprocess.DEVNULL,
                stdout=printed,
                stderr=said,
                start_new_session=True,
            )

    def members(self) -> list[psutil.Process]:
        """Every process that has come of the job and runs.

        One that ends has no environment any more, and still holds its locks: it is known from before.
        """
        self.launcher.poll()  # reaps it
        self._known.update(process for process in psutil.process_iter() if self._has_mark(process))
        return alive(list(self._known))

    def _has_mark(self, process: psutil.Process) -> bool:
        try:
            return process.environ().get(MARK) == self._mark
        except psutil.Error:
            return False

    def victim(self, name: str, chance: random.Random) -> psutil.Process | None:
        """A process that plays this part; None if there is none yet, or no more."""
        found = [process for process in self.members() if part_of(process, self.launcher.pid) == name]
        return chance.choice(found) if found else None

    def send(self, plan: Plan, chance: random.Random) -> bool:
        """Send the signal, and tell whether there was a process to take it."""
        number = SIGNALS[plan.signal]
        self.members()
        if plan.victim == "group":
            with suppress(ProcessLookupError):
                os.killpg(self.launcher.pid, number)
            return self.launcher.poll() is None
        victim = self.victim(plan.victim, chance)
        if victim is None:
            return False
        with suppress(psutil.NoSuchProcess):
            victim.send_signal(number)
            return True
        return False

    def wait(self) -> float | None:
        """Wait until no process is left and return the seconds that it took; None if it hangs."""
        begin = time.monotonic()
        while self.members():
            if time.monotonic() - begin > HANG_SECONDS:
                return None
            time.sleep(0.05)
        return time.monotonic() - begin

    def end(self) -> None:
        """Kill what is left."""
        for process in self.members():
            with suppress(psutil.NoSuchProcess):
                process.kill()
        self.launcher.wait()

    @property
    def answer(self) -> dict[str, Any] | None:
        """What it has printed, once that is whole.  A launcher may print of a signal before it and after."""
        _, brace, rest = self._printed.read_text().partition("{\n")
        try:
            answer, _ = json.JSONDecoder().raw_decode(brace + rest)
        except json.JSONDecodeError:
            return None
        return dict(answer)

    @property
    def said(self) -> str:
        """Standard error so far."""
        return self._said.read_text()


def part_of(process: psutil.Process, launcher: int) -> str:
    with suppress(psutil.Error):
        if process.pid == launcher:
            return "launcher"
        if "proxy" in process.name():
            return "proxy"
        if "PMI_RANK" in process.environ() and "ensemble" in process.cmdline():
            return "rank"
    return "other"


class Series:
    """Tries in one store after the other.

    Parameters
    ----------
    directory : Path
        New, for the stores and what the jobs print.
    seed : int
        Of all that is drawn.
    earliest : float
        Seconds after the start at which signals begin.
    """

    def __init__(self, directory: Path, seed: int, earliest: float = EARLIEST) -> None:
        self._directory = directory
        self._chance = random.Random(seed)
        self._earliest = earliest
        self._stores = 0
        self._store = self._new_store()
        self.tries: list[Try] = []
        self.ignored = 0
        self.completed = 0
        self.brackets: set[str] = set()

    def _new_store(self) -> Path:
        self._stores += 1
        path = self._directory / str(self._stores) / "store"
        path.parent.mkdir(parents=True)
        return path

    def go_on(self) -> Try | None:
        """Make a try; None if the job came to its end, or could not be hit, before the signal."""
        plan = Plan.draw(self._chance, self._earliest)
        job = Job(plan.ranks, [*STUDY, f"--store={self._store}"], self._store.parent)
        try:
            time.sleep(plan.moment)
            known = _keys(self._store)
            hit = job.send(plan, self._chance)
            made_before = _keys(self._store)
            seconds = job.wait() if hit else self._let_finish(job)
            left = [part_of(process, job.launcher.pid) for process in job.members()]
        finally:
            job.end()
        status = job.launcher.returncode
        # A job that was in the last steps of its last runs, one at a time on each rank, had nothing to stop.
        nothing_left = len(_keys(self._store) - made_before) <= max(plan.ranks, 1)
        if not hit or (job.answer is not None and seconds is not None and nothing_left):
            if status == 0 or job.answer is not None:
                self._complete(job)
            return None
        made = Try(plan, HANG_SECONDS if seconds is None else seconds, status, job.said, left)
        made.faults = [*_faults(made, job.answer is not None), *_store_faults(self._store, known)]
        if plan.is_ignored and not made.faults:
            self.ignored += 1
        else:
            self.tries.append(made)
        if job.answer is not None:
            self._complete(job)
        return made

    def _let_finish(self, job: Job) -> float:
        while job.members():
            time.sleep(0.1)
        return 0.0

    def _complete(self, job: Job) -> None:
        assert job.answer is not None
        self.brackets.add(json.dumps([point["bracket"] for point in job.answer["boundary"]]))
        self.completed += 1
        self._store = self._new_store()

    def figures(self) -> dict[str, Any]:
        """Count."""
        seconds = sorted(made.seconds for made in self.tries)
        return {
            "tries": len(self.tries),
            "ignored by the proxy": self.ignored,
            "faults": Counter(fault for made in self.tries for fault in made.faults),
            "seconds until no process was left": {
                name: round(seconds[min(int(share * len(seconds)), len(seconds) - 1)], 2)
                for name, share in (("median", 0.5), ("90 %", 0.9), ("99 %", 0.99), ("most", 1.0))
            },
            f"later than {LEFT_SECONDS:g} s": sum(each > LEFT_SECONDS for each in seconds),
            "statuses": Counter(f"{made.plan.signal} {made.status}" for made in self.tries),
            "studies completed": self.completed,
            "different brackets": len(self.brackets),
        }


def _faults(made: Try, has_answered: bool) -> list[str]:
    faults = []
    if made.left:
        faults.append("hung")
    if made.seconds > LEFT_SECONDS and not made.plan.is_ignored:
        faults.append("slow")
    if (made.status == 0) != made.plan.is_ignored:
        faults.append("ended" if made.plan.is_ignored else "swallowed")
    if TRACES.search(made.said):
        faults.append("traceback")
    if made.said.count("ensemble: interrupted") > 1:
        faults.append("more than one line")
    if has_answered and made.status != 0:
        faults.append("printed")
    if made.status == 0 and not has_answered:
        faults.append("nothing printed")
    return faults


def _keys(store: Path) -> set[str]:
    """The runs that exist at this moment."""
    try:
        with Store.existing(store) as opened:
            return {summary.key for summary in opened.summaries()}
    except ValueError:  # not made yet
        return set()


def _store_faults(store: Path, known: set[str]) -> list[str]:
    """Whether what was there is there, whole, and the store can be written to."""
    with Store.open(store) as opened:
        problems = opened.check()
        lost = known - {summary.key for summary in opened.summaries()}
        opened.boundaries()
        unswept = any((store / "staging").iterdir())
    return ["damaged"] * bool(problems) + ["lost"] * bool(lost) + ["unswept"] * unswept


def main() -> None:
    """Send signals, count and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory", type=Path)
    parser.add_argument("--tries", type=int, default=500)
    parser.add_argument("--seed", type=int, default=13)
    options = parser.parse_args()
    options.directory.mkdir(parents=True)
    series = Series(options.directory, options.seed)
    with (options.directory / "tries.jsonl").open("w") as log:
        while len(series.tries) < options.tries:
            made = series.go_on()
            if made is None:
                continue
            print(json.dumps(asdict(made)), file=log, flush=True)
            if made.faults:
                print(len(series.tries), made.plan, f"{made.seconds:.2f} s", *made.faults, file=sys.stderr)
    print(json.dumps(series.figures(), indent=2))


if __name__ == "__main__":
    main()
