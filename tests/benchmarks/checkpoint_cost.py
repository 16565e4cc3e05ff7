"""Measures what a checkpoint takes of the minute between two of them.

    python -m tests.benchmarks.checkpoint_cost DIRECTORY

The directory is on the disk that is meant.  Each scene has come some way, so that there is a history to keep.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from statistics import median

from ensemble.config.checkpoint_interval import DEFAULT_SECONDS
from ensemble.config.documents import load_scene
from ensemble.store import Store
from ensemble.store.checkpoint import checkpoint_path
from solver import Simulation

TIMES = 10
SCENES = (
    ("doublet-shear", ("horizon=100.0", "criteria.revolutions=1000"), 340),
    ("suspension-shear", ("arrangement.count=24",), 10),
    ("suspension-shear", ("arrangement.count=256",), 2),
)


def main() -> None:
    """Take steps, write checkpoints and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory", type=Path, help="new, for a store")
    options = parser.parse_args()
    with Store.open(options.directory) as store:
        for preset, changes, steps in SCENES:
            scene = load_scene(preset, changes)
            checkpoint = store.checkpoint(scene)
            simulation = Simulation(scene, sink=checkpoint.record)
            for _ in range(steps):
                simulation.step()
            seconds = []
            for _ in range(TIMES):
                begin = time.perf_counter()
                checkpoint.write(simulation.saved())
                seconds.append(time.perf_counter() - begin)
            size = checkpoint_path(store.path, checkpoint.key).stat().st_size
            begin = time.perf_counter()
            saved = checkpoint.read()
            assert saved is not None
            Simulation.restored(scene, saved, sink=checkpoint.record)
            restored = time.perf_counter() - begin
            print(
                f"{preset} {' '.join(changes)}, step {steps}: {size / 1e6:.2f} MB, written in "
                f"{1e3 * median(seconds):.0f} ms, {median(seconds) / DEFAULT_SECONDS:.2%} of the time; "
                f"read and restored in {restored:.2f} s"
            )
            checkpoint.remove()


if __name__ == "__main__":
    main()
