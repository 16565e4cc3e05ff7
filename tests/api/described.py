"""Requests made up from the description of the service in OpenAPI, with the checks of schemathesis."""

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

# Keys of things that are there, or most requests would find nothing.  What a schema cannot say, such as that
# vesicles must not overlap, is refused with 422.
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
class RequestVerdict:
    """How many requests were made, and what schemathesis says of the answers."""

    cases: int
    passed: bool
    text: str


def try_everything(directory: Path, *options: str, seconds: float) -> RequestVerdict:
    """Serve a filled store and send what schemathesis makes up.

    Parameters
    ----------
    directory : Path
        An empty one.
    options : str
        Of ``schemathesis run``.
    seconds : float
        After which the run is given up.
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
    # To delete a job is to dismiss it: it stays, as one that has been dismissed.
    command += ["--exclude-checks=use_after_free"]
    # What listens to a job does not end before the job, and nobody runs any here.
    command += ["--exclude-path-regex=/events$", f"--header=Authorization: Bearer {token}", *options]
    unlimited = {"request_rate": "1000000/second", "refusal_rate": "1000000/second", "maximum_jobs": 10**6}
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
    return RequestVerdict(int(counted[1]) if counted else 0, done.returncode == 0, done.stdout + done.stderr)
