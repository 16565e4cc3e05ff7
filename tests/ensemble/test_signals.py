"""Signals at random moments of studies, as `tests.benchmarks.signals` sends more of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.benchmarks.signals import Series

TRIES = 10  # of each seed
EARLIEST = 0.5  # seconds in which the interpreter itself has started, also on a busy machine

pytestmark = pytest.mark.usefixtures("finished_study")  # the kernels are compiled


@pytest.mark.long
@pytest.mark.parametrize("seed", [5, 6, 7])
def test_no_signal_hangs_a_study_or_costs_a_run(tmp_path: Path, seed: int) -> None:
    """How long the end takes depends on the machine, and the benchmark measures it."""
    series = Series(tmp_path, seed, EARLIEST)
    while len(series.tries) < TRIES:
        series.go_on()
    faults = [(made.plan, fault) for made in series.tries for fault in made.faults if fault != "slow"]
    assert faults == []
    assert len(series.brackets) <= 1
