"""Sends at least 10,000 made-up requests to the service: ``python -m tests.benchmarks.openapi_cases``.

Every check of schemathesis is on; the exit status is 0 only if all answers pass.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tests.api.described import try_everything

CASES = 10_000
SECONDS = 3600
OPTIONS = ("--phases=coverage,fuzzing", "--max-examples=840", "--continue-on-failure", "--seed=6")


def main() -> None:
    """Print what schemathesis says."""
    with tempfile.TemporaryDirectory() as directory:
        verdict = try_everything(Path(directory), *OPTIONS, seconds=SECONDS)
    print(verdict.text)
    print(f"{verdict.cases} requests")
    sys.exit(0 if verdict.passed and verdict.cases >= CASES else 1)


if __name__ == "__main__":
    main()
