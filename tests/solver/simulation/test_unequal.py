"""Vesicles of unequal reduced area, length and bending modulus: the slack one wraps the round one."""

from __future__ import annotations

import numpy as np
import pytest

from solver.analysis.run import Outcome, Run
from solver.membrane.geometry import Geometry, Membranes
from solver.potentials.proximity import Closeness
from solver.scene import Numerics, PowerLaw, Scene, Vesicle
from solver.simulation.simulate import simulate

DISTANCE = 0.25


def relaxed(hamaker: float) -> tuple[Run, Geometry]:
    vesicles = (
        Vesicle(reduced_area=0.6, length=3 * np.pi, bending_modulus=0.3, center=(-0.8, 0.0)),
        Vesicle(reduced_area=0.98, length=1.5 * np.pi, center=(1.2, 0.0)),
    )
    scene = Scene(
        horizon=400.0,
        vesicles=vesicles,
        adhesion=PowerLaw(hamaker=hamaker, distance=DISTANCE),
        numerics=Numerics(points=96, tolerance=1e-4),
    )
    run = simulate(scene)
    membranes = Membranes.of_scene(scene)
    state = membranes.pack(run.frames.tangent_angle[-1], run.frames.center[-1])
    return run, Geometry(membranes, state)


def share_in_contact(geometry: Geometry) -> float:
    """Share of the second vesicle's points within one and a half adhesion distances of the first."""
    distances = Closeness(geometry).distances[1, 0] * geometry.membranes.spacing[0]
    return float(np.mean(distances < 1.5 * DISTANCE))


@pytest.fixture(scope="module")
def weak() -> tuple[Run, Geometry]:
    return relaxed(0.1)


@pytest.fixture(scope="module")
def strong() -> tuple[Run, Geometry]:
    return relaxed(5.0)


def test_unequal_vesicles_come_to_rest(weak: tuple[Run, Geometry], strong: tuple[Run, Geometry]) -> None:
    for run, _ in (weak, strong):
        assert run.outcome is Outcome.EQUILIBRIUM
        assert run.gap is not None
        assert 0.5 * DISTANCE < run.gap < 1.2 * DISTANCE
        assert run.error.area < 2e-2


def test_strong_adhesion_wraps_the_slack_one_around_the_round_one(
    weak: tuple[Run, Geometry], strong: tuple[Run, Geometry]
) -> None:
    (_, touching), (_, wrapped) = weak, strong
    assert touching.curvature[0].min() > -0.7
    assert wrapped.curvature[0].min() < -1  # nearly as hollow as the other is round
    assert share_in_contact(wrapped) > 0.5
    assert share_in_contact(wrapped) > 1.5 * share_in_contact(touching)
