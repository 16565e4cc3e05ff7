"""A Slurm cluster of the tests' own, from the system's packages: one node with two processors."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import psutil

ROOT = 0
SECONDS = 600  # until something is given up; no test measures time by this
PROCESSORS = 2
DAEMONS = ("munged", "slurmctld", "slurmd")

# Jobs have other numbers than those of other clusters on this machine: MPI names shared memory by them.
CONFIGURATION = """\
ClusterName=tests
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmctldPort={controller_port}
SlurmdPort={node_port}
AuthInfo=socket={directory}/munge/socket
StateSaveLocation={directory}/state
SlurmdSpoolDir={directory}/spool
SlurmctldPidFile={directory}/slurmctld.pid
SlurmdPidFile={directory}/slurmd.pid
SlurmctldLogFile={directory}/slurmctld.log
SlurmdLogFile={directory}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
MpiDefault=pmi2
FirstJobId={first_job}
SchedulerParameters=sched_interval=1,batch_sched_delay=0,bf_interval=2
KillWait=5
ReturnToService=2
NodeName={host} NodeAddr=127.0.0.1 CPUs={processors} State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


@dataclass
class Cluster:
    """A cluster, reached through the file that SLURM_CONF names."""

    directory: Path
    daemons: list[subprocess.Popen[bytes]] = field(default_factory=list)

    @property
    def variables(self) -> dict[str, str]:
        """What a program needs in its environment to use this cluster."""
        return {"SLURM_CONF": str(self.directory / "slurm.conf")}

    def run(self, *command: str | Path, **variables: str) -> subprocess.CompletedProcess[str]:
        """Run a command of Slurm and wait for its end."""
        return subprocess.run(
            [str(word) for word in command],
            env=os.environ | self.variables | variables,
            cwd=self.directory,
            capture_output=True,
            text=True,
            timeout=SECONDS,
            check=False,
        )

    def submit(self, *arguments: str | Path, **variables: str) -> str:
        """Submit a batch script, with these variables in its environment, and return the job's number."""
        submitted = self.run("sbatch", "--parsable", *arguments, **variables)
        assert submitted.returncode == 0, submitted.stderr
        return submitted.stdout.strip()

    def jobs(self, *options: str) -> list[str]:
        """Return the numbers of the jobs that wait, run or end just now."""
        return self.run("squeue", "--noheader", "--format=%A", *options).stdout.split()

    def details(self, job: str) -> dict[str, str]:
        """Return what the controller knows of a job, also for a while after its end."""
        shown = self.run("scontrol", "--oneliner", "show", "job", job).stdout
        return dict(part.split("=", 1) for part in shown.split() if "=" in part)

    def wait(self, job: str) -> dict[str, str]:
        """Wait for the end of a job and return what the controller knows of it."""
        deadline = time.monotonic() + SECONDS
        while job in self.jobs():
            assert time.monotonic() < deadline, f"job {job} does not end: {self.details(job)}"
            time.sleep(0.2)
        return self.details(job)

    def wait_until_requeued(self, job: str, times: int = 1) -> None:
        """Wait until a job is queued again, and let it start soon, not after the delay of two minutes.

        In the second in which it has ended its node takes it for one that is canceled, and it fails.
        """
        requeued = {"Restarts": str(times), "JobState": "PENDING"}
        _wait_for(lambda: requeued.items() <= self.details(job).items())
        self.run("scontrol", "update", f"jobid={job}", "starttime=now+3seconds")

    def start(self) -> None:
        """Start it, and return when its node takes jobs."""
        for name in ("munge", "state", "spool"):
            (self.directory / name).mkdir()
        ports = _free_ports(2)
        (self.directory / "slurm.conf").write_text(
            CONFIGURATION.format(
                host=socket.gethostname().split(".")[0],
                controller_port=ports[0],
                node_port=ports[1],
                first_job=1000 * ports[0],
                directory=self.directory,
                processors=PROCESSORS,
            )
        )
        munge = self.directory / "munge"
        (munge / "key").write_bytes(os.urandom(1024))
        (munge / "key").chmod(0o400)
        files = [f"--{name}-file={munge / name}" for name in ("key", "pid", "seed", "log")]
        self._run_daemon("munged", "--foreground", "--force", f"--socket={munge / 'socket'}", *files)
        _wait_for((munge / "socket").exists)
        self._run_daemon("slurmctld", "-D")
        self._run_daemon("slurmd", "-D")
        _wait_for(lambda: "idle" in self.run("sinfo", "--noheader", "--format=%T").stdout)

    def stop(self) -> None:
        """End all jobs, then the daemons, and what may be left of either."""
        for job in self.jobs():
            self.run("scancel", job)
        with suppress(TimeoutError):
            _wait_for(lambda: not self.jobs())
        for daemon in reversed(self.daemons):
            daemon.send_signal(signal.SIGTERM)
            with suppress(subprocess.TimeoutExpired):
                daemon.wait(10)
        for process in self.members():
            with suppress(psutil.NoSuchProcess):
                process.kill()
        for daemon in self.daemons:
            daemon.wait()

    def members(self) -> list[psutil.Process]:
        """Return the processes of the daemons and of jobs, which have inherited the name of the file."""
        return [process for process in psutil.process_iter() if self._is_member(process)]

    def _is_member(self, process: psutil.Process) -> bool:
        try:
            return process.environ().get("SLURM_CONF") == self.variables["SLURM_CONF"]
        except psutil.Error:
            return False

    def _run_daemon(self, name: str, *arguments: str) -> None:
        with (self.directory / f"{name}.out").open("wb") as output:
            command = [_program(name), *arguments]
            environment = os.environ | self.variables
            self.daemons.append(
                subprocess.Popen(command, env=environment, stdout=output, stderr=subprocess.STDOUT)
            )


def reason_to_skip() -> str | None:
    """Return why no cluster can be started on this machine; None if one can."""
    if missing := [name for name in DAEMONS if _program(name) is None]:
        return f"no {', '.join(missing)}: install the system's packages slurm-wlm and munge"
    return None if os.geteuid() == ROOT else "only root can start the daemons of Slurm"


@contextmanager
def running() -> Iterator[Cluster]:
    """Run a cluster."""
    # Short, because the path of a socket is; readable, because munged refuses a directory that is not.
    directory = Path(tempfile.mkdtemp(prefix="slurm-"))
    directory.chmod(0o755)
    cluster = Cluster(directory)
    try:
        try:
            cluster.start()
            yield cluster
        finally:
            cluster.stop()
    finally:
        shutil.rmtree(directory)


def write_script(path: Path, lines: Sequence[str]) -> Path:
    """Write a batch script."""
    path.write_text("\n".join(["#!/usr/bin/env bash", "set -euo pipefail", *lines, ""]), encoding="utf-8")
    return path


def _program(name: str) -> str | None:
    return shutil.which(name, path=f"{os.environ['PATH']}:/usr/sbin:/sbin")


def _free_ports(number: int) -> list[int]:
    sockets = [socket.socket() for _ in range(number)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [int(one.getsockname()[1]) for one in sockets]
    for one in sockets:
        one.close()
    return ports


def _wait_for(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + SECONDS
    while not condition():
        if time.monotonic() > deadline:
            raise TimeoutError("Slurm does not do what was waited for")
        time.sleep(0.1)
