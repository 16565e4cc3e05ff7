"""The image of `deploy/Containerfile`, built and run: a service in it runs a job on two ranks."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

import pytest

from api.client import Client
from api.jobs.job import JobStatus
from tests.api.processes import wait_until

ROOT = Path(__file__).parents[2]
SECONDS = 900  # to build; the image takes its packages from an index
WORK = ("doublet-shear", {"horizon": 4.0})

pytestmark = pytest.mark.long


class Containers:
    """Podman, or Docker, with an image and a volume of its own."""

    def __init__(self, program: str) -> None:
        self.program = program
        self.image = self.volume = f"vesicle-ensemble-{uuid4().hex}"

    def call(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        command = [self.program, *arguments]
        return subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)

    def ensemble(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run a command of `ensemble` in a container that is removed afterwards."""
        return self.call("run", "--rm", f"--volume={self.volume}:/store", self.image, *arguments)

    @contextmanager
    def serving(self) -> Iterator[str]:
        """Run the image as its README says; gives the address."""
        options = ("--detach", "--init", "--publish=127.0.0.1::8000", f"--volume={self.volume}:/store")
        started = self.call("run", *options, self.image)
        assert started.returncode == 0, started.stderr
        container = started.stdout.strip()
        try:
            yield f"http://{self.call('port', container, '8000').stdout.strip()}"
        finally:
            self.call("rm", "--force", container)


@pytest.fixture(scope="module")
def containers() -> Iterator[Containers]:
    program = next(filter(None, map(shutil.which, ("podman", "docker"))), None)
    if program is None:
        pytest.skip("neither podman nor docker is installed")
    containers = Containers(program)
    file = ROOT / "deploy" / "Containerfile"
    (base,) = re.findall(r"^FROM (\S+)$", file.read_text(encoding="utf-8"), flags=re.MULTILINE)
    found = containers.call("image", "inspect", base)
    if found.returncode != 0:
        pytest.skip(f"{program} has no image {base}: {found.stderr.strip()}")
    built = containers.call("build", f"--file={file}", f"--tag={containers.image}", str(ROOT))
    assert built.returncode == 0, built.stderr
    yield containers
    containers.call("volume", "rm", "--force", containers.volume)
    containers.call("rmi", "--force", containers.image)


def test_a_service_in_a_container_runs_a_job(containers: Containers) -> None:
    refused = containers.ensemble()
    assert refused.returncode == 2, "others reach it, and there is no token"
    assert "ensemble token create" in refused.stderr
    made = containers.ensemble("token", "create", "ada", "--store", "/store")
    assert made.returncode == 0, made.stderr
    with containers.serving() as address, Client(address, made.stdout.split()[-1]) as client:
        wait_until(lambda: client.get("/readyz").is_success)
        job = client.wait(client.submit(*WORK, ranks=2))
        assert job.status is JobStatus.SUCCEEDED, client.log(job)
        assert client.run(job.key).summary.scene.horizon == WORK[1]["horizon"]
    listed = containers.ensemble("query", "runs", "--store", "/store", "--json")
    assert job.key in listed.stdout
