"""How busy groups of ranks are."""

from __future__ import annotations

import pytest

from ensemble.mpi.usage import UsageMeter


def test_busy_time_counts_until_a_group_has_nothing_left_to_run() -> None:
    now = 0.0
    meter = UsageMeter(2, lambda: now)
    now = 10.0
    meter.record_run(0, 9.0)
    meter.record_run(1, 5.0)
    meter.record_idle(1)
    now = 12.0
    meter.record_idle(0)  # an answer has made another run useful
    now = 20.0
    meter.record_run(0, 10.0)
    meter.record_idle(1)
    now = 30.0
    meter.record_run(1, 18.0)  # eight of these seconds are after the other group became idle
    meter.record_idle(2)
    # A run is recorded when it ends.  Until the first idle moment that is 9 + 10 and 5 + 8 of 20 seconds.
    assert meter.fractions() == pytest.approx((19 / 20, 13 / 20))
    assert UsageMeter(2, lambda: 0.0).fractions() == ()


def test_the_first_run_of_a_group_says_nothing_about_the_next_ones() -> None:
    """It waits for the kernels to be loaded or compiled."""
    meter = UsageMeter(2, lambda: 0.0)
    meter.record_run(0, 100.0)
    meter.record_run(1, 100.0)
    assert meter.mean_run is None
    meter.record_run(0, 1.0)
    meter.record_run(0, 3.0)
    assert meter.mean_run == pytest.approx(2.0)
