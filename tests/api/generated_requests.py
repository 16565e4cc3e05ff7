"""Requests that schemathesis generates from the OpenAPI description of the service, with its checks."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from api.auth import TokenScope
from ensemble.store import Store
from tests.api.servers import make_token, serving
from tests.api.stores import fill

# Keys that exist: with random ones most requests would end in 404. A schema cannot express every rule, for
# example that vesicles must not overlap, so valid documents may be refused with 422.
CONFIGURATION = """
[checks.positive_data_acceptance]
expected-statuses = ["2xx", "404", "422"]

[[operations]]
include-path-regex = "^/runs/"
parameters = {{ "path.key" = "{run}" }}

[[operations]]
include-path-regex = "^/boundaries/"
parameters = {{ "path.key" = "{boundary}" }}
"""


@dataclass(frozen=True)
class GeneratedRequests:
    """How many requests were sent, whether all answers passed the checks, and the report of schemathesis."""

    cases: int
    passed: bool
    text: str


def send_generated_requests(directory: Path, *options: str, seconds: float) -> GeneratedRequests:
    """Serve a filled store, and send generated requests.

    Parameters
    ----------
    directory : Path
        An empty directory.
    *options : str
        Options of ``schemathesis run``.
    seconds : float
        Time limit.
    """
    store = fill(directory / "store")
    with Store.existing(store) as opened:
        (boundary,) = opened.boundaries()
        run = opened.summaries(["outcome=bound"])[0]
    (directory / "schemathesis.toml").write_text(
        CONFIGURATION.format(run=run.key, boundary=boundary.study_key), encoding="utf-8"
    )
    token = make_token(store, "ada", TokenScope.SUBMIT)
    command = [str(Path(sys.executable).with_name("schemathesis")), "run", "--checks=all", "--no-color"]
    # DELETE dismisses a job; the job stays and can be read.
    command += ["--exclude-checks=use_after_free"]
    # Events end with the job, and no worker runs it here.  Files take seconds to make, movies more.
    command += ["--exclude-path-regex=/(events|file)$", f"--header=Authorization: Bearer {token}", *options]
    unlimited = {"maximum_jobs": 10**6} | {
        f"{what}_rate": "1000000/second" for what in ("request", "submission", "refusal")
    }
    with serving(store, **unlimited) as address:
        done = subprocess.run(
            [*command, f"{address}/openapi.json"],
            cwd=directory,
            capture_output=True,
            text=True,
            timeout=seconds,
            check=False,
        )
    counted = re.search(r"(\d+) generated", done.stdout)
    return GeneratedRequests(
        int(counted[1]) if counted else 0, done.returncode == 0, done.stdout + done.stderr
    )
