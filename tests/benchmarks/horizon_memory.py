"""The memory of a run against its horizon: ``python -m tests.benchmarks.horizon_memory DIRECTORY``.

A pair in shear is recorded so often that what it records would soon be most of its memory.  Printed are the
largest resident memory of the process, its processor time and the size of its last checkpoint.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

from ensemble.config.checkpoint_interval import CHECKPOINT_SECONDS
from ensemble.store.checkpoint import checkpoint_path, checkpointed_keys

ARGUMENTS = (
    *("run", "doublet-shear", "--set=criteria.revolutions=100000", "--progress=json"),
    *("--set=numerics.points=32", "--set=numerics.tolerance=1e-3"),
    *("--set=output.interval=0.001", "--set=output.frame_interval=0.004"),
)


def largest_checkpoint(store: Path) -> int:
    """Return the size of the checkpoints that there are now, in bytes."""
    try:
        sizes = [checkpoint_path(store, key).stat().st_size for key in checkpointed_keys(store)]
    except FileNotFoundError:  # its run has just been committed
        return 0
    return max(sizes, default=0)


def main() -> None:
    """Make runs, watch their checkpoints and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory", type=Path, help="new, for a store")
    parser.add_argument("--horizons", type=float, nargs="+", default=[10.0, 100.0, 1000.0])
    options = parser.parse_args()
    for horizon in options.horizons:
        given = (f"--set=horizon={horizon}", f"--store={options.directory}")
        process = subprocess.Popen(
            [sys.executable, "-m", "ensemble", *ARGUMENTS, *given],
            env=os.environ | {CHECKPOINT_SECONDS: "2"},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        largest = 0
        while True:
            ended, status, usage = os.wait4(process.pid, os.WNOHANG)
            if ended:
                break
            largest = max(largest, largest_checkpoint(options.directory))
            time.sleep(0.05)
        process.returncode = os.waitstatus_to_exitcode(status)
        print(
            f"horizon {horizon:g}: status {process.returncode}, {usage.ru_maxrss / 1024:.1f} MB, "
            f"{usage.ru_utime + usage.ru_stime:.1f} s, checkpoints of {largest / 1e6:.2f} MB at most",
            flush=True,
        )


if __name__ == "__main__":
    main()
