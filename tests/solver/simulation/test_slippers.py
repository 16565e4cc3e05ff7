"""A vesicle in Poiseuille flow becomes a slipper or symmetric, as published."""

from __future__ import annotations

import numpy as np
import pytest

from solver.analysis.run import Outcome, Run
from solver.flows import Poiseuille
from solver.scene import Numerics, Scene, Vesicle
from solver.simulation.simulate import simulate
from tests.benchmarks.slippers import PUBLISHED

# By it rates become published peak velocities, in units of 400 µm/s: the one number that is fitted.
SCALE = 8.0


def final(reduced_area: float, rate: float, offset: float = 0.5, half_width: float = 1.0) -> Run:
    vesicle = Vesicle(reduced_area=reduced_area, center=(0.0, offset))
    points = 96 if reduced_area < 0.7 else 64
    flow = Poiseuille(rate=rate, half_width=half_width)
    run = simulate(Scene(horizon=4000.0, vesicles=(vesicle,), flow=flow, numerics=Numerics(points=points)))
    assert run.outcome is Outcome.STEADY
    assert run.viscosity is None
    return run


def inclination(run: Run) -> float:
    assert run.inclination_angle is not None
    return abs(run.inclination_angle)


@pytest.mark.parametrize(
    ("reduced_area", "number"),
    [(0.6, 1), (0.6, 2), (0.6, 3), (0.7, 1), (0.7, 2), (0.8, 1), (0.8, 3), (0.9, 1)],
)
def test_inclinations_are_the_published_ones(reduced_area: float, number: int) -> None:
    expected = PUBLISHED[reduced_area][number - 1]
    assert inclination(final(reduced_area, number * SCALE)) == pytest.approx(expected, abs=3.0)


def test_a_slipper_is_beside_the_center_line_on_either_side() -> None:
    above, below = final(0.7, 4.0), final(0.7, 4.0, offset=-0.5)
    assert above.frames.center[-1, 0, 1] > 0.1
    assert below.frames.center[-1, 0, 1] == pytest.approx(-above.frames.center[-1, 0, 1], rel=1e-6)
    assert inclination(below) == pytest.approx(inclination(above), abs=1e-4)


def test_a_symmetric_vesicle_is_on_the_center_line() -> None:
    run = final(0.7, 32.0)
    assert inclination(run) == pytest.approx(90.0, abs=0.01)
    assert run.frames.center[-1, 0, 1] == pytest.approx(0.0, abs=1e-4)


def test_only_the_curvature_of_the_profile_counts() -> None:
    """The same curvature with another half-width adds the difference of the peak velocities."""
    narrow, wide = final(0.7, 4.0), final(0.7, 12.0, half_width=3.0)
    assert inclination(wide) == pytest.approx(inclination(narrow), abs=1e-3)
    speeds = [
        (run.frames.center[-1, 0, 0] - run.frames.center[-2, 0, 0])
        / (run.frames.time[-1] - run.frames.time[-2])
        for run in (narrow, wide)
    ]
    assert np.diff(speeds)[0] == pytest.approx((12.0 * 3.0 - 4.0) / 2, rel=1e-4)
