"""Roots of functions of one variable."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from solver.roots import root

MOST_CALLS = 60  # bisection alone takes 42 to 1e-12

FUNCTIONS: dict[str, tuple[Callable[[float], float], float, float, float]] = {
    "line": (lambda x: 3.0 * x - 1.0, 0.0, 1.0, 1 / 3),
    "falling": (lambda x: math.cos(x) - 0.5, 0.0, 3.0, math.pi / 3),
    "flat": (lambda x: (x - 0.7) ** 3, 0.0, 1.0, 0.7),
    "steep": (lambda x: math.atan(1e6 * (x - 0.2)), -1.0, 2.0, 0.2),
    "exponential": (lambda x: math.exp(x) - 1e-3, -50.0, 10.0, math.log(1e-3)),
    "at the first end": (lambda x: x, 0.0, 1.0, 0.0),
    "at the last end": (lambda x: x - 1.0, 0.0, 1.0, 1.0),
    "backwards": (lambda x: x**2 - 2.0, 2.0, 0.0, math.sqrt(2)),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_root_is_found_to_the_tolerance(name: str) -> None:
    function, first, last, expected = FUNCTIONS[name]
    calls = []

    def counted(x: float) -> float:
        calls.append(x)
        return function(x)

    assert root(counted, first, last, 1e-12) == pytest.approx(expected, rel=1e-15, abs=1e-12)
    assert len(calls) <= MOST_CALLS
    assert all(min(first, last) <= x <= max(first, last) for x in calls)


def test_a_smooth_function_takes_few_evaluations() -> None:
    calls: list[float] = []
    root(lambda x: calls.append(x) or math.exp(x) - 2.0, 0.0, 1.0, 1e-15)  # type: ignore[func-returns-value]
    assert len(calls) <= 12


def test_round_off_bounds_what_is_asked_for() -> None:
    assert root(lambda x: x - 1e6, 0.0, 3e6, 0.0) == pytest.approx(1e6, rel=1e-15)


@pytest.mark.parametrize("last", [2.0, math.nan])
def test_a_root_that_need_not_exist_is_refused(last: float) -> None:
    with pytest.raises(ValueError, match="no change of sign"):
        root(lambda x: x, 1.0, last)
