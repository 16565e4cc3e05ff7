"""A run needs no more memory the longer it is."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from ensemble.config.checkpoint_interval import CHECKPOINT_SECONDS
from ensemble.store import Store
from tests.conftest import ENSEMBLE

pytestmark = pytest.mark.usefixtures("finished_study")  # the kernels are compiled

DENSE = (
    *("run", "doublet-shear", "--set=criteria.revolutions=100000", "--progress=json"),
    *("--set=numerics.points=32", "--set=numerics.tolerance=1e-3"),
    *("--set=output.interval=0.002", "--set=output.frame_interval=0.01"),
)


def peak(store: Path, horizon: float) -> int:
    """The largest resident memory of a process that makes a run of this horizon, in KiB."""
    process = subprocess.Popen(
        [*ENSEMBLE, *DENSE, f"--set=horizon={horizon}", f"--store={store}"],
        env=os.environ | {CHECKPOINT_SECONDS: "1"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    return usage.ru_maxrss


@pytest.mark.long
def test_ten_times_the_horizon_takes_the_same_memory(tmp_path: Path) -> None:
    once, ten_times = (peak(tmp_path / "store", horizon) for horizon in (10.0, 100.0))
    assert ten_times < 1.05 * once
    with Store.existing(tmp_path / "store") as store:
        samples = [len(store.load(summary.key).series["time"]) for summary in store.summaries()]
        assert samples == [5001, 50001]
        assert store.check() == []
