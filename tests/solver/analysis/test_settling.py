"""When a motion counts as settled: decided on sequences of half turns whose end is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from solver.analysis.settling import convergence, has_settled

if TYPE_CHECKING:
    from collections.abc import Callable

Array = NDArray[np.float64]
TOLERANCE = 0.01


def first_settled(sequence: Array) -> int | None:
    """Number of half turns after which the motion counts as settled."""
    counts = range(1, len(sequence) + 1)
    return next((count for count in counts if has_settled(sequence[:count], TOLERANCE)), None)


def approach(multiplier: float, deviation: float, count: int) -> Array:
    """Half turns whose distance to a settled motion is multiplied by a factor in each."""
    return np.log(30.0) + deviation * multiplier ** np.arange(count)[:, None]


def iterates(function: Callable[[float], float], start: float, count: int) -> Array:
    values = [start]
    while len(values) < count:
        values.append(function(values[-1]))
    return np.log(values)[:, None]


@given(multiplier=st.floats(-0.9, 0.9), deviation=st.floats(1e-6, 0.5))
def test_a_stable_motion_settles_once_it_will_change_no_more(multiplier: float, deviation: float) -> None:
    sequence = approach(multiplier, deviation, 120)
    count = first_settled(sequence)
    assert count is not None
    cycle = np.resize(sequence[count - 2 : count], sequence[count:].shape)
    assert np.abs(sequence[count:] - cycle).max() <= 2 * TOLERANCE


@given(multiplier=st.floats(1.3, 3.0), sign=st.sampled_from([-1, 1]), deviation=st.floats(5e-3, 0.5))
def test_a_motion_that_leaves_an_unstable_one_never_settles(
    multiplier: float, sign: int, deviation: float
) -> None:
    assert first_settled(approach(sign * multiplier, deviation, 12)) is None


@pytest.mark.parametrize("passage", [2e-3, 1e-2])
def test_a_motion_that_lingers_where_two_have_vanished_does_not_settle(passage: float) -> None:
    """x → x + passage + x²: from x < 0 it slows down, and then it speeds up."""
    values = [-0.3]
    while values[-1] < 0.5:
        values.append(values[-1] + passage + values[-1] ** 2)
    assert len(values) > 20
    assert first_settled(np.array(values)[:, None]) is None


@pytest.mark.parametrize(("growth", "settles"), [(2.8, True), (3.2, True), (3.5, False), (3.9, False)])
@pytest.mark.parametrize("start", [0.11, 0.23, 0.42, 0.77])
def test_a_map_settles_if_it_has_a_cycle_of_one_or_two(growth: float, settles: bool, start: float) -> None:
    """x → growth·x(1 − x): a fixed point up to 3, a cycle of two up to 3.449, of four up to 3.54; chaos."""
    sequence = iterates(lambda x: growth * x * (1 - x), start, 60)
    assert (first_settled(sequence) is not None) is settles


def test_two_half_turns_that_agree_by_chance_prove_nothing() -> None:
    """The largest distances of a pair that later separates, at a viscosity contrast of 6 and H = 0.321."""
    assert first_settled(np.log([10.7905, 10.7819, 9.6462, 9.6364, 7.4398, 7.0686])[:, None]) is None


def test_all_quantities_must_settle() -> None:
    still = np.zeros((6, 1))
    assert has_settled(still, TOLERANCE)
    assert not has_settled(np.hstack([still, 0.1 * np.arange(6.0)[:, None]]), TOLERANCE)


def test_convergence_is_extrapolated_as_a_geometric_series() -> None:
    halving, by_two = convergence(approach(0.5, 1.0, 6))
    assert halving.change == pytest.approx(2.0**-5)
    assert halving.remaining == pytest.approx(2.0**-5)
    assert by_two.remaining == pytest.approx(2.0**-4)
    assert convergence(approach(0.5, 1.0, 2)) == []
    assert convergence(approach(1.5, 1.0, 3))[0].remaining == np.inf
