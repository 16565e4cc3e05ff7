"""Half turns of lines, against rigid rotation and Jeffery's orbit, in steps shorter and longer than turns."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.analysis.long_axis import LongAxisTracker
from solver.analysis.revolutions import counted_direction
from solver.analysis.run import Outcome
from solver.flows import Linear, Shear
from solver.integrators import Step
from solver.membrane.geometry import Membranes
from solver.scene import Numerics, Scene, Vesicle
from solver.simulation.initial_state import placed_state
from solver.simulation.simulate import simulate

Array = NDArray[np.float64]

ASPECT_RATIO = 6.0
JEFFERY_PERIOD = 2 * np.pi * (ASPECT_RATIO + 1 / ASPECT_RATIO)  # at shear rate 1


def rigid_rotation(time: float) -> float:
    """Angle of a line that turns clockwise, once in 2π."""
    return -time


def jeffery_orbit(time: float) -> float:
    """Angle of the long axis of a rigid ellipse in shear (Jeffery 1922), from the direction of flow on."""
    turn = 2 * np.pi * time / JEFFERY_PERIOD
    sine, cosine = np.sin(turn), np.cos(turn)
    ahead = np.arctan2((1 / ASPECT_RATIO - 1) * sine * cosine, cosine**2 + sine**2 / ASPECT_RATIO)
    return -float(turn + ahead)


@pytest.mark.parametrize("length", [0.1, 0.4, 0.5, 0.7, 1.0, 2.3])  # of a step, in turns
@pytest.mark.parametrize(
    ("angle", "period"),
    [(rigid_rotation, 2 * np.pi), (jeffery_orbit, JEFFERY_PERIOD)],
    ids=["rigid rotation", "Jeffery's orbit"],
)
def test_no_half_turn_is_lost(angle: Callable[[float], float], period: float, length: float) -> None:
    """The axis begins along x, so that it stands across the flow after each odd number of quarter turns."""
    vesicle = Vesicle(reduced_area=0.7, angle=0.0)
    scene = Scene(horizon=1.0, vesicles=(vesicle,), flow=Shear(rate=1.0), numerics=Numerics(points=32))
    start = placed_state(scene)
    tangents = np.append(np.ones(32), np.zeros(2))

    def state(time: float) -> Array:
        return start + angle(time) * tangents

    tracker = LongAxisTracker(Membranes.of_scene(scene), start, counted_direction(scene.flow))
    turns, passages = 7.1, list[float]()
    for first, last in pairwise(period * np.append(np.arange(0, turns, length), turns)):
        tracker.advance(Step(first, last, state(last), state, local_error=0.0, shortened=False))
        passages += tracker.latest
        middle = 0.5 * (first + last)
        assert tracker.angle_of(state(middle), middle) == pytest.approx(angle(middle), abs=1e-9)
    assert tracker.angle == pytest.approx(angle(period * turns), abs=1e-9)
    np.testing.assert_allclose(passages, period * (np.arange(14) + 0.5) / 2, rtol=1e-9)
    assert tracker.period == pytest.approx(period, rel=1e-9)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
@pytest.mark.parametrize("flow_type", [-1.0, -0.98])
def test_a_vesicle_turns_where_rotation_prevails(flow_type: float, tolerance: float) -> None:
    """In time steps longer than a quarter turn.

    Jeffery's periods are between those of a circle and a needle, here 5e-5 apart.  A vesicle deforms besides.
    """
    flow = Linear(rate=1.0, flow_type=flow_type)
    numerics = Numerics(points=32, tolerance=tolerance)
    scene = Scene(horizon=60.0, vesicles=(Vesicle(reduced_area=0.7),), flow=flow, numerics=numerics)
    run = simulate(scene)
    assert run.outcome is Outcome.TUMBLING
    assert run.period == pytest.approx(2 * np.pi / flow.angular_velocity, rel=1e-3)
