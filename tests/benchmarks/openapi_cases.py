"""Sends at least 10,000 made-up requests to the service: ``python -m tests.benchmarks.openapi_cases``.

Every check of schemathesis is on; the exit status is 0 only if all answers pass.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tests.api.generated_requests import send_generated_requests

CASES = 10_000
SECONDS = 3600
OPTIONS = ("--phases=coverage,fuzzing", "--max-examples=840", "--continue-on-failure", "--seed=6")


def main() -> None:
    """Print what schemathesis says."""
    with tempfile.TemporaryDirectory() as directory:
        result = send_generated_requests(Path(directory), *OPTIONS, seconds=SECONDS)
    print(result.text)
    print(f"{result.cases} requests")
    sys.exit(0 if result.passed and result.cases >= CASES else 1)


if __name__ == "__main__":
    main()
