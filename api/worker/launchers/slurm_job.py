"""Submits a job to Slurm and follows it to its end, as if its ranks were here.

    python -m api.worker.launchers.slurm_job --name NAME --ranks 4 --seconds 3600 --files PREFIX -- COMMAND...

What the ranks write to standard error is passed on while they run, standard output at the end, and the exit
status is theirs.  SIGTERM is passed on to them; a job that still waits is canceled.

Nothing is left over, and nothing runs twice: earlier jobs of the same name are canceled first, and a job ends
itself when nobody has followed it for `UNFOLLOWED_SECONDS`, because its worker was killed.
"""

from __future__ import annotations

import argparse
import math
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from api.worker.launchers.launcher import TIME_LIMIT_STATUS
from ensemble.display.progress_line import ProgressLine
from ensemble.errors import SUSPENDED_STATUS

UNFOLLOWED_SECONDS = 30
LOOK_SECONDS = 1.0
_LOST_SECONDS = 60.0  # after which a job of which Slurm knows nothing is given up
_WAITING = {"PENDING", "CONFIGURING", "SUSPENDED"}
_RUNNING = {"RUNNING", "COMPLETING", "STOPPED", "SIGNALING", "RESIZING"}

# The node's clock is compared with itself: what is asked is whether the file has changed since the last look.
SCRIPT = """\
#!/usr/bin/env bash
guard() {{
    local seen="" now still=0
    while ((still < {unfollowed})); do
        sleep 5
        now=$(stat --format=%Y {followed} 2> /dev/null) || now=missing
        if [[ $now == "$seen" || $now == missing ]]; then ((still += 5)); else still=0; fi
        seen=$now
    done
    scancel "$SLURM_JOB_ID"
}}
guard &
status=0
srun --kill-on-bad-exit=1 {command} || status=$?
kill %1
exit "$status"
"""


def main() -> None:
    """Submit the job of the arguments, follow it, and exit with its status."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--name", required=True)
    parser.add_argument("--ranks", type=int, required=True)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--files", type=Path, required=True)
    parser.add_argument("--option", action="append", default=[])
    parser.add_argument("command", nargs="+")
    arguments = parser.parse_args()
    job = SlurmJob(arguments.name, arguments.files)
    job.submit(arguments.ranks, arguments.seconds, arguments.option, arguments.command)
    signal.signal(signal.SIGTERM, lambda *_: job.suspend())
    try:
        status = job.follow(arguments.seconds)
        sys.stdout.write(job.output())
    finally:
        job.remove_files()
    sys.exit(status)


class SlurmJob:
    """A job of Slurm.

    Parameters
    ----------
    name : str
        By which it is found again.
    files : Path
        How the paths of its files begin; every node sees them.
    """

    def __init__(self, name: str, files: Path) -> None:
        self._name = name
        self._output = files.with_suffix(".output")
        self._errors = files.with_suffix(".errors")
        self._followed = files.with_suffix(".followed")
        self._number = ""
        self._passed = 0
        self._state = "PENDING"
        self._waits = False
        self._asked_to_end = False
        self._told_to_end = False

    def submit(self, ranks: int, seconds: float, options: Sequence[str], command: Sequence[str]) -> None:
        """Submit it, once no earlier one of its name is left.

        Parameters
        ----------
        ranks : int
        seconds : float
            For which they may run.
        options : sequence of str
            Further ones of `sbatch`.
        command : sequence of str
            Of each rank.
        """
        while self._cancel():
            time.sleep(LOOK_SECONDS)
        self.remove_files()
        self._followed.touch()
        script = SCRIPT.format(
            unfollowed=UNFOLLOWED_SECONDS,
            followed=shlex.quote(str(self._followed)),
            command=shlex.join(command),
        )
        submitted = subprocess.run(
            [
                *("sbatch", "--parsable", "--no-requeue", f"--job-name={self._name}", f"--ntasks={ranks}"),
                f"--time={math.ceil(seconds / 60) + 2}",  # minutes; this program ends it before
                *(f"--output={self._output}", f"--error={self._errors}", *options),
            ],
            input=script, stdout=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
        if submitted.returncode != 0:
            sys.exit(1)  # sbatch has said why
        self._number = submitted.stdout.strip().split(";")[0]
        print(f"job {self._number} of Slurm", file=sys.stderr, flush=True)

    def follow(self, seconds: float) -> int:
        """Wait for its end.

        Parameters
        ----------
        seconds : float
            For which the ranks may run.

        Returns
        -------
        int
            Their exit status.
        """
        deadline = math.inf
        known = time.monotonic()
        while True:
            self._followed.touch()
            details = self._details()
            if details:
                known = time.monotonic()
                self._note(details.get("JobState", ""))
            self._pass_on_errors()
            if self._state in _RUNNING:
                deadline = min(deadline, time.monotonic() + seconds)
                self._tell_to_end_if_asked()
            elif self._state not in _WAITING:
                self._pass_on_errors(to_the_end=True)
                return self._status(details)
            elif self._asked_to_end:
                self._cancel()
                return SUSPENDED_STATUS
            if time.monotonic() > deadline:
                self._cancel()
                return TIME_LIMIT_STATUS
            if time.monotonic() > known + _LOST_SECONDS:
                print(f"Slurm knows nothing of its job {self._number}", file=sys.stderr)
                return 1
            time.sleep(LOOK_SECONDS)

    def suspend(self) -> None:
        """Let the ranks keep their runs and end; if they wait for their start the job is canceled."""
        self._asked_to_end = True

    def end(self) -> None:
        """Cancel it, and all others of its name, and remove its files."""
        self._cancel()
        self.remove_files()

    def output(self) -> str:
        """Return what the ranks have printed."""
        try:
            return self._output.read_text(encoding="utf-8", errors="replace")
        except FileNotFoundError:
            return ""

    def remove_files(self) -> None:
        """Remove what it has written."""
        for path in (self._output, self._errors, self._followed):
            path.unlink(missing_ok=True)

    def _cancel(self) -> bool:
        """Cancel all jobs of this name; tell whether there was one, which may still be ending."""
        there = _slurm("squeue", "--noheader", "--format=%A", f"--name={self._name}", "--me").split()
        if there:
            _slurm("scancel", *there)
        return bool(there)

    def _details(self) -> dict[str, str]:
        """Return what Slurm knows of it; nothing if it does not answer."""
        shown = _slurm("scontrol", "--oneliner", "show", "job", self._number)
        return dict(part.split("=", 1) for part in shown.split() if "=" in part)

    def _note(self, state: str) -> None:
        if state == "PENDING" and not self._waits:
            waiting = ProgressLine(fraction=0.0, message="waits in the queue of Slurm", reached=0.0)
            print(waiting.model_dump_json(), file=sys.stderr, flush=True)
        self._waits = state == "PENDING"
        self._state = state

    def _tell_to_end_if_asked(self) -> None:
        # Once: a second signal ends the ranks before they have kept anything.
        if self._asked_to_end and not self._told_to_end:
            self._told_to_end = True
            _slurm("scancel", "--signal=TERM", self._number)

    def _status(self, details: dict[str, str]) -> int:
        exited, _, number = details.get("ExitCode", "1:0").partition(":")
        status = 128 + int(number) if int(number) else int(exited)
        if self._told_to_end and status == 128 + signal.SIGTERM:  # before there was anything to keep
            return SUSPENDED_STATUS
        if self._state == "TIMEOUT":
            return TIME_LIMIT_STATUS
        if self._state not in ("COMPLETED", "FAILED"):  # canceled, preempted, its node failed
            print(f"job {self._number} of Slurm: {self._state}", file=sys.stderr)
            return 1
        return status

    def _pass_on_errors(self, to_the_end: bool = False) -> None:
        """Write what has been added to the file of standard error: whole lines, or all of it."""
        with suppress(FileNotFoundError), self._errors.open("rb") as file:
            file.seek(self._passed)
            new = file.read()
            whole = new if to_the_end else new[: new.rfind(b"\n") + 1]
            self._passed += len(whole)
            sys.stderr.write(whole.decode(errors="replace"))
            sys.stderr.flush()


def _slurm(*command: str) -> str:
    """Return what a command of Slurm prints; nothing if it fails, as while the controller is away."""
    result = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=False
    )
    return result.stdout if result.returncode == 0 else ""


if __name__ == "__main__":
    main()
