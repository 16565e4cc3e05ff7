"""Traces the boundary at viscosity contrasts of 6 and 8 from ten guesses and limits, on one to three ranks.

``python -m tests.benchmarks.guesses DIRECTORY [--tolerance 0.01]`` prints a row for each search and exits
with 1 unless all answers at a contrast are equal.  The searches on the same number of ranks share a store in
the directory: the first makes most of the runs, the others choose theirs anew and find them there.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.conftest import ENSEMBLE

CONTRASTS = (6.0, 8.0)
RANKS = (1, 2, 3)
# A guess, or none, and limits.
SEARCHES = (
    ((0.35, 0.38), (0.05, 5.0)),
    ((0.09, 0.11), (0.05, 5.0)),
    ((0.15, 0.20), (0.02, 10.0)),
    ((0.5, 0.6), (0.08, 3.0)),
    ((2.0, 3.0), (0.05, 5.0)),
    (None, (0.05, 5.0)),
    (None, (0.1, 2.0)),
    (None, (0.02, 10.0)),
    ((0.27, 0.28), (0.2, 1.0)),
    ((0.06, 0.07), (0.03, 0.7)),
)


def search(store: Path, ranks: int, contrast: float, tolerance: float, which: int) -> tuple[object, ...]:
    """Trace one point; its bracket, outcomes, changes, status and the number of its runs."""
    guess, limits = SEARCHES[which]
    guesses = "[]" if guess is None else f"[{{at = 1.0, bracket = {list(guess)}}}]"
    changes = (f"sweep.values=[{contrast}]", f"search.guesses={guesses}", f"search.limits={list(limits)}")
    sets = [word for change in changes for word in ("--set", change)]
    mpirun = shutil.which("mpirun") or "mpirun"
    launcher = [] if ranks == 1 else [mpirun, "-n", str(ranks)]
    study = ["bisect", "critical-hamaker-contrast", *sets, "--tolerance", str(tolerance)]
    result = subprocess.run(
        [*launcher, *ENSEMBLE, *study, "--store", str(store), "--json"],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    if not result.stdout:
        sys.exit(result.stderr)
    (point,) = json.loads(result.stdout)["boundary"]
    brackets = [change["bracket"] for change in point["changes"]]
    return point["bracket"], point["outcomes"], brackets, point["status"], len(point["runs"])


def main() -> int:
    """Run every search and compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("directory", type=Path)
    parser.add_argument("--tolerance", type=float, default=0.05)
    chosen = parser.parse_args()
    print("| contrast | ranks | guess | limits | bracket | status | runs |\n|---|---|---|---|---|---|---|")
    same = True
    for contrast in CONTRASTS:
        answers = set()
        for ranks in RANKS:
            for which, (guess, limits) in enumerate(SEARCHES):
                answer = search(chosen.directory / str(ranks), ranks, contrast, chosen.tolerance, which)
                bracket, _, _, status, runs = answer
                print(
                    f"| {contrast:g} | {ranks} | {guess} | {limits} | {bracket} | {status} | {runs} |",
                    flush=True,
                )
                answers.add(repr(answer[:-1]))
        searches = len(RANKS) * len(SEARCHES)
        print(f"contrast {contrast:g}: {len(answers)} different answers in {searches} searches")
        same &= len(answers) == 1
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
